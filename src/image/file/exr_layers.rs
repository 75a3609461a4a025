//! Which channels of an OpenEXR file are the picture.
//!
//! A file may hold one part or several, each with channels `R G B` or groups such as `ViewLayer.Combined.R`. What is wanted
//! is radiance. Renderers write albedo, normals and the like beside it in the same way, so that the names decide: those that
//! mean the whole picture come first, those that mean a part of it are never taken without being asked for.

use super::format::implausible;
use crate::error::{Error, ErrorKind, Finding, Place, Result, Severity};
use std::path::Path;

/// A part of a file: its name and the names of its channels.
pub struct Part {
    /// Name of the part; empty when it has none.
    pub name: String,
    /// Channels in the order of the file; none for deep parts.
    pub channels: Vec<String>,
}

/// Three channels of colour that belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Index of its part.
    pub part: usize,
    /// Its name; empty for the plain channels of a file with one part.
    pub name: String,
    /// Indices of red, green and blue in the part.
    pub channels: [usize; 3],
    /// Index of the opacity.
    pub alpha: Option<usize>,
}

/// Last parts of names that mean the whole picture, the surest first.
const WHOLE: [&str; 16] = [
    "combined",
    "composite",
    "beauty",
    "rgba",
    "rgb",
    "c",
    "color",
    "colour",
    "ci",
    "image",
    "final",
    "main",
    "default",
    "denoised",
    "denoised image",
    "noisy image",
];

/// Parts of names that mean a part of the picture or no light at all.
const PARTS: [&str; 40] = [
    "albedo",
    "alpha",
    "ambient",
    "ao",
    "background",
    "caustic",
    "coat",
    "coverage",
    "crypto",
    "depth",
    "diff",
    "direct",
    "emi",
    "env",
    "gloss",
    "id",
    "indirect",
    "light",
    "mask",
    "material",
    "matte",
    "mist",
    "motion",
    "normal",
    "object",
    "occlusion",
    "opacity",
    "pos",
    "reflect",
    "refract",
    "rough",
    "scatter",
    "shadow",
    "sheen",
    "spec",
    "sss",
    "trans",
    "uv",
    "vector",
    "volume",
];

/// How likely a name means radiance of the whole picture; lower is likelier.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Whole(usize),
    Unknown,
    PartOfIt,
}

fn kind_of(name: &str) -> Kind {
    if name.is_empty() {
        return Kind::Whole(0);
    }
    let last = last_of(name).to_lowercase().replace('_', " ");
    if let Some(place) = WHOLE.iter().position(|whole| *whole == last) {
        return Kind::Whole(place + 1);
    }
    let is_part = PARTS.iter().any(|part| last.contains(part)) || matches!(last.as_str(), "n" | "p" | "z" | "st");
    if is_part { Kind::PartOfIt } else { Kind::Unknown }
}

fn last_of(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or(name)
}

/// All layers of colour of a file.
pub fn layers_of(parts: &[Part]) -> Vec<Layer> {
    let mut layers: Vec<Layer> = Vec::new();
    for (index, part) in parts.iter().enumerate() {
        let find = |prefix: &str, letters: [&str; 2]| {
            part.channels.iter().position(|name| {
                name.strip_prefix(prefix)
                    .is_some_and(|rest| letters.iter().any(|letter| rest.eq_ignore_ascii_case(letter)))
            })
        };
        for channel in &part.channels {
            let prefix = match channel.rfind('.') {
                Some(dot) => &channel[..=dot],
                None => "",
            };
            let letters = [["R", "red"], ["G", "green"], ["B", "blue"]];
            let [Some(red), Some(green), Some(blue)] = letters.map(|letters| find(prefix, letters)) else { continue };
            if part.channels[red] != *channel {
                continue;
            }
            let group = prefix.trim_end_matches('.');
            let name = match (group.is_empty(), part.name.is_empty() || parts.len() == 1) {
                (_, true) => group.to_owned(),
                (true, false) => part.name.clone(),
                (false, false) if group.starts_with(&part.name) => group.to_owned(),
                (false, false) => format!("{}.{group}", part.name),
            };
            let alpha = find(prefix, ["A", "alpha"]);
            layers.push(Layer { part: index, name, channels: [red, green, blue], alpha });
        }
    }
    layers
}

/// The layer to read: that of this name, or the one that means the whole picture. `None` where the file has no colour.
///
/// # Errors
/// `InvalidSetting` when no or several layers have the name; `InvalidScene` when names do not say which layer is radiance.
/// Both list the layers.
pub fn choose<'a>(layers: &'a [Layer], wanted: Option<&str>, path: &Path) -> Result<Option<&'a Layer>> {
    let list = || layers.iter().map(|layer| format!("'{}'", layer.name)).collect::<Vec<_>>().join(", ");
    if let Some(wanted) = wanted {
        let same = |name: &str| name.eq_ignore_ascii_case(wanted);
        let exact = layers.iter().filter(|layer| same(&layer.name)).collect::<Vec<_>>();
        let ends = layers.iter().filter(|layer| same(last_of(&layer.name))).collect::<Vec<_>>();
        return match (exact.as_slice(), ends.as_slice()) {
            ([layer], _) | ([], [layer]) => Ok(Some(layer)),
            (found, _) => {
                let how_many = if found.is_empty() && ends.is_empty() { "no layer" } else { "more than one layer" };
                Err(Error::new(
                    ErrorKind::InvalidSetting,
                    format!("{how_many} is named '{wanted}': there are {}", list()),
                )
                .at(Place::File(path.into()))
                .remedy("give the name of one of them"))
            }
        };
    }
    let best = layers.iter().min_by_key(|layer| kind_of(&layer.name));
    match best.map(|layer| (layer, kind_of(&layer.name))) {
        None => Ok(None),
        Some((layer, Kind::Whole(_))) => Ok(Some(layer)),
        Some((layer, Kind::Unknown))
            if layers.iter().filter(|layer| kind_of(&layer.name) == Kind::Unknown).count() == 1 =>
        {
            Ok(Some(layer))
        }
        Some(_) => Err(Error::new(
            ErrorKind::InvalidScene,
            format!("the names of the layers do not say which one is the radiance of the picture: {}", list()),
        )
        .at(Place::File(path.into()))
        .remedy(ONE_LAYER)),
    }
}

/// What helps whoever reads the picture: lights and pictures of single objects have no option for it.
const ONE_LAYER: &str = "save the layer that is meant alone, as a picture of its own; for the photos of a scene, `patina check` and `patina fit` \
                         take its name: --layer NAME";

/// Tells which layer is read, where there was a choice or a name.
pub fn told(layers: &[Layer], chosen: &Layer) -> Option<Finding> {
    if layers.len() < 2 && chosen.name.is_empty() {
        return None;
    }
    let name = |layer: &Layer| if layer.name.is_empty() { "R G B".to_owned() } else { layer.name.clone() };
    let others: Vec<String> = layers.iter().filter(|layer| *layer != chosen).take(8).map(name).collect();
    let beside = if others.is_empty() { String::new() } else { format!(", not {}", others.join(", ")) };
    let finding = Finding::new(Severity::Note, "exr-layer", format!("the layer '{}' is read{beside}", name(chosen)));
    Some(if others.is_empty() { finding } else { finding.remedy(ONE_LAYER) })
}

/// Where a data window lies in the display window, and the size of the latter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placed {
    /// Width and height of the picture.
    pub size: (usize, usize),
    /// Column and row of the picture's first stored pixel; negative where the file holds more than the picture.
    pub offset: (i64, i64),
    /// Width and height of what is stored.
    pub stored: (usize, usize),
}

impl Placed {
    /// Whether the two windows are one.
    pub fn is_whole(&self) -> bool {
        self.offset == (0, 0) && self.size == self.stored
    }

    /// Index of the stored pixel at a row and column of the picture; `None` outside the data window.
    pub fn stored_index(&self, row: usize, column: usize) -> Option<usize> {
        let x = usize::try_from(column as i64 - self.offset.0).ok().filter(|x| *x < self.stored.0)?;
        let y = usize::try_from(row as i64 - self.offset.1).ok().filter(|y| *y < self.stored.1)?;
        Some(y * self.stored.0 + x)
    }

    /// Errors for a display window that is far larger than what is stored: memory would be taken for nothing.
    pub fn check(&self, path: &Path) -> Result<()> {
        const LARGEST_WITHOUT_DOUBT: usize = 1 << 24;
        let (picture, stored) = (self.size.0.saturating_mul(self.size.1), self.stored.0.saturating_mul(self.stored.1));
        if picture > LARGEST_WITHOUT_DOUBT && picture / 64 > stored {
            return Err(implausible(
                path,
                format!(
                    "{} x {} pixels are stored of a picture of {} x {}",
                    self.stored.0, self.stored.1, self.size.0, self.size.1
                ),
            ));
        }
        Ok(())
    }

    /// Tells that the windows differ.
    pub fn told(&self) -> Option<Finding> {
        let ((width, height), (stored_width, stored_height)) = (self.size, self.stored);
        let message = format!(
            "{stored_width} x {stored_height} pixels at column {} and row {} are stored of a picture of {width} x {height}: \
             pixels outside are not seen",
            self.offset.0, self.offset.1
        );
        let seen = |offset: i64, stored: usize, size: usize| {
            let end = offset.saturating_add(stored as i64).clamp(0, size as i64);
            (end - offset.clamp(0, end)) as f64 / size.max(1) as f64
        };
        let share = seen(self.offset.0, stored_width, width) * seen(self.offset.1, stored_height, height);
        // A window that only holds more than the picture hides nothing, and is told all the same.
        let hidden = (1.0 - share).max(f64::EPSILON);
        (!self.is_whole()).then(|| Finding::new(Severity::Note, "exr-window", message).extent(hidden))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(name: &str, channels: &[&str]) -> Part {
        Part { name: name.into(), channels: channels.iter().map(|name| (*name).to_owned()).collect() }
    }

    fn chosen(parts: &[Part], wanted: Option<&str>) -> Result<String> {
        let layers = layers_of(parts);
        choose(&layers, wanted, Path::new("a.exr")).map(|layer| layer.map_or("none".into(), |layer| layer.name.clone()))
    }

    #[test]
    fn the_whole_picture_is_chosen_and_a_part_of_it_never_in_silence() {
        let rgb = |group: &str| ["B", "G", "R"].map(|letter| format!("{group}.{letter}"));
        let of = |groups: &[&str]| {
            vec![Part { name: String::new(), channels: groups.iter().flat_map(|group| rgb(group)).collect() }]
        };
        let blender = of(&["ViewLayer.DiffCol", "ViewLayer.Noisy Image", "ViewLayer.Normal"]);
        assert_eq!(chosen(&blender, None).unwrap(), "ViewLayer.Noisy Image");
        assert_eq!(chosen(&blender, Some("diffcol")).unwrap(), "ViewLayer.DiffCol");
        let both = of(&["ViewLayer.Noisy Image", "ViewLayer.Combined"]);
        assert_eq!(chosen(&both, None).unwrap(), "ViewLayer.Combined");
        assert_eq!(chosen(&of(&["albedo", "hero"]), None).unwrap(), "hero");
        for unclear in [of(&["albedo", "normal"]), of(&["albedo"]), of(&["left", "right"])] {
            let error = chosen(&unclear, None).unwrap_err();
            assert_eq!(error.remedy_text(), ONE_LAYER);
        }
        let error = chosen(&blender, Some("glossy")).unwrap_err();
        assert!(error.message().contains("'ViewLayer.DiffCol'"), "{error}");
        assert_eq!(chosen(&of(&["a.x", "b.x"]), Some("x")).unwrap_err().kind(), ErrorKind::InvalidSetting);
    }

    #[test]
    fn parts_and_plain_channels_are_layers() {
        let parts = [part("albedo", &["B", "G", "R"]), part("rgba", &["A", "B", "G", "R"])];
        assert_eq!(chosen(&parts, None).unwrap(), "rgba");
        assert_eq!(layers_of(&parts)[1], Layer { part: 1, name: "rgba".into(), channels: [3, 2, 1], alpha: Some(0) });
        // A lone picture is the picture, whatever its part is called.
        assert_eq!(chosen(&[part("albedo", &["B", "G", "R", "N.B", "N.G", "N.R"])], None).unwrap(), "");
        assert_eq!(chosen(&[part("", &["Z"])], None).unwrap(), "none");
    }

    #[test]
    fn windows_are_placed_and_overscan_is_cut() {
        let inside = Placed { size: (4, 3), offset: (1, 1), stored: (2, 2) };
        assert_eq!(
            (inside.stored_index(0, 1), inside.stored_index(1, 1), inside.stored_index(2, 2)),
            (None, Some(0), Some(3))
        );
        assert_eq!(inside.stored_index(1, 3), None);
        let overscan = Placed { size: (2, 2), offset: (-1, -1), stored: (4, 4) };
        assert_eq!(overscan.stored_index(0, 0), Some(5));
        assert!(Placed { size: (1 << 14, 1 << 14), offset: (0, 0), stored: (2, 2) }.check(Path::new("a")).is_err());
    }
}
