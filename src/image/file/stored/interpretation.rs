//! What colours the samples of a file are.

use super::{Declared, Stored};
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use crate::image::file::colour::{ColourSpace, Curve};
use crate::image::file::format::{Format, Source};
use crate::image::file::guard;
use crate::image::file::photo::Encoding;
use crate::image::file::profile::{self, Profile};

/// How the samples are to be understood.
#[allow(clippy::large_enum_variant, reason = "there is one for each file that is open")]
pub(super) enum Interpretation {
    Space(ColourSpace),
    Tables(std::sync::Arc<moxcms::TransformF32Executor>),
}

/// By what the user says of the curve, then the profile, then what the file declares, then the kind of the numbers.
pub(super) fn interpretation(
    stored: &Stored,
    source: &Source,
    encoding: Encoding,
    is_float: bool,
    findings: &mut Vec<Finding>,
) -> Result<Interpretation> {
    let curve = match encoding {
        Encoding::Auto => None,
        Encoding::Srgb => Some(Curve::Srgb),
        Encoding::Linear => Some(Curve::Linear),
        Encoding::Gamma22 => Some(Curve::Gamma(2.2)),
    };
    let with_curve = |space: ColourSpace| match &curve {
        Some(curve) => ColourSpace {
            curves: [curve.clone(), curve.clone(), curve.clone()],
            rec709_from_rgb: space.rec709_from_rgb,
        },
        None => space,
    };
    if let (Declared::NotRead(what), None) = (&stored.declared, &curve) {
        return Err(Error::new(ErrorKind::Unsupported, format!("the photo is encoded as {what}, which is not read"))
            .at(Place::File(source.path.clone()))
            .remedy("export it as sRGB, or linear with 16 bits or as OpenEXR"));
    }
    let note = |code, message: String| Finding::new(Severity::Note, code, message);
    let found = stored.icc.as_deref().map(|bytes| {
        let read = guard::guarded(&source.path, || Ok(profile::read(bytes)));
        (bytes.len(), read.ok().flatten())
    });
    let space = match found {
        Some((_, Some(named))) => {
            let name = if named.name.is_empty() { "without a name".into() } else { format!("'{}'", named.name) };
            match named.profile {
                Profile::Other(space) => return Err(refused(source, space)),
                Profile::Tables(_) if curve.is_some() => {
                    findings.push(note(
                        "profile-set-aside",
                        format!(
                            "the colour profile {name} consists of tables: it is set aside since an encoding is given"
                        ),
                    ));
                    ColourSpace::of_curve(Curve::Srgb)
                }
                Profile::Tables(transform) => {
                    findings.push(note(
                        "colour-converted",
                        format!("colours are converted from the profile {name} to linear Rec. 709"),
                    ));
                    return Ok(Interpretation::Tables(transform));
                }
                Profile::Matrix(space) => {
                    if !space.is_srgb() {
                        findings.push(note(
                            "colour-converted",
                            format!("colours are converted from the profile {name} to linear Rec. 709"),
                        ));
                    }
                    space
                }
            }
        }
        Some((length, None)) => {
            let taken = if curve.is_some() || is_float {
                "its primaries are taken for those of sRGB"
            } else {
                "the photo is taken for sRGB"
            };
            findings.push(
                Finding::new(
                    Severity::Warning,
                    "profile-damaged",
                    format!("the colour profile of {length} bytes cannot be read: {taken}"),
                )
                .remedy("export the photo again with an sRGB or Display P3 profile"),
            );
            ColourSpace::of_curve(if is_float { Curve::Linear } else { Curve::Srgb })
        }
        None => match &stored.declared {
            Declared::Space(space, by) => {
                findings.push(note("colour-converted", format!("colours are converted by {by} to linear Rec. 709")));
                space.clone()
            }
            _ if is_float => ColourSpace::of_curve(Curve::Linear),
            // Where the user says how it is encoded, nothing is taken for sRGB that may be otherwise.
            Declared::Uncalibrated if curve.is_none() => {
                let message = "EXIF says that colours are not sRGB, and no profile says what they are: taken for sRGB";
                let remedy = "export the photos with their colour profile; cameras write so for Adobe RGB";
                findings.push(Finding::new(Severity::Warning, "colour-uncalibrated", message).remedy(remedy));
                ColourSpace::of_curve(Curve::Srgb)
            }
            _ => {
                // A PNG without a profile is one of sRGB by its standard; others may have lost theirs on the way.
                if curve.is_none() && source.header.format != Format::Png {
                    findings.push(note("profile-missing", "no colour profile is embedded: taken for sRGB".into()));
                }
                ColourSpace::of_curve(Curve::Srgb)
            }
        },
    };
    Ok(Interpretation::Space(with_curve(space)))
}

/// Colours that are not light: inks, or other spaces.
pub fn refused(source: &Source, space: &str) -> Error {
    Error::new(ErrorKind::Unsupported, format!("the photo is in {space}: its colours are not those of a camera"))
        .at(Place::File(source.path.clone()))
        .remedy("export it in RGB, with an sRGB or Display P3 profile")
}
