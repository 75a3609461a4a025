//! Findings as they are kept: with their place as a value, and their code found again among those that there are.

use crate::error::{Finding, Place, Severity};
use serde::{Deserialize, Serialize};

/// Codes of the check and of the atlas. A finding of another code is not kept, nor is what it belongs to: a test holds this
/// list against the sources.
const CODES: &[&str] = &[
    "atlas-gutter",
    "atlas-overlap",
    "atlas-rebuilt",
    "camera-convention",
    "camera-invalid",
    "camera-mirrored",
    "camera-off-centre",
    "cameras-at-one-place",
    "cameras-repeated",
    "cameras-upside-down",
    "detail-too-fine",
    "encoding-looks-linear",
    "encoding-looks-srgb",
    "exposure-jump",
    "exposure-varies",
    "few-views",
    "light-differs",
    "light-in-groups",
    "light-turns-with-camera",
    "map-size",
    "mask-overlap-low",
    "masks-and-mesh-disagree",
    "mesh-back-faces",
    "mesh-coarse",
    "mesh-degenerate",
    "mesh-duplicate",
    "mesh-duplicate-faces",
    "mesh-inside-out",
    "mesh-non-manifold",
    "mesh-thin",
    "mesh-touching",
    "mesh-unreferenced",
    "mesh-unusable",
    "mesh-winding",
    "no-views",
    "normals-inside-out",
    "normals-noisy",
    "normals-opposed",
    "photo-black",
    "photo-clipped",
    "photo-misplaced",
    "photo-turned",
    "photo-white",
    "photos-disagree",
    "photos-exchanged",
    "photos-identical",
    "photos-shifted",
    "pixel-centre-assumed",
    "pixel-centre-measured",
    "pixel-centre-off",
    "up-inverted",
    "view-sees-nothing",
    "views-see-nothing",
];

/// A finding with everything it holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct KeptFinding {
    severity: Severity,
    code: String,
    message: String,
    place: String,
    target: Place,
    remedy: String,
    extent: f64,
}

impl KeptFinding {
    /// To be written.
    pub fn of(finding: &Finding) -> Self {
        let Finding { severity, code, message, place, target, remedy, extent } = finding.clone();
        KeptFinding { severity, code: code.into(), message, place, target, remedy, extent }
    }

    /// As it was; `None` where the code is neither one of the `read` findings, which the scene came with, nor known here.
    pub fn finding(self, read: &[Finding]) -> Option<Finding> {
        let KeptFinding { severity, code, message, place, target, remedy, extent } = self;
        let mut codes = CODES.iter().copied().chain(read.iter().map(|finding| finding.code));
        let code = codes.find(|known| *known == code)?;
        Some(Finding { severity, code, message, place, target, remedy, extent })
    }
}

/// Findings to be written; `None` where one would not be found again.
pub(super) fn to_keep(findings: &[Finding], read: &[Finding]) -> Option<Vec<KeptFinding>> {
    let kept: Vec<KeptFinding> = findings.iter().map(KeptFinding::of).collect();
    let back = of_kept(kept.clone(), read)?;
    (back == findings).then_some(kept)
}

/// Findings that were written.
pub(super) fn of_kept(kept: Vec<KeptFinding>, read: &[Finding]) -> Option<Vec<Finding>> {
    kept.into_iter().map(|finding| finding.finding(read)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn every_code_of_check_and_atlas_is_known() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let mut looked_at = 0;
        let mut folders = ["scene/doctor", "atlas"].map(|folder| root.join(folder)).to_vec();
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                    continue;
                }
                let text = std::fs::read_to_string(&path).unwrap();
                let text = text.split("#[cfg(test)]").next().unwrap_or_default();
                let is_part = |part: &str| {
                    !part.is_empty() && part.bytes().all(|own| own.is_ascii_lowercase() || own.is_ascii_digit())
                };
                for word in text.split('"').filter(|word| word.contains('-') && word.split('-').all(is_part)) {
                    assert!(CODES.contains(&word), "{word} in {}", path.display());
                    looked_at += 1;
                }
            }
        }
        assert!(looked_at > 40, "{looked_at} codes found");
    }

    #[test]
    fn findings_come_back_with_their_places_and_unknown_ones_are_not_kept() {
        let pixel = Place::Pixel { view: "0001".into(), row: 3, column: 4 };
        let findings = [
            Finding::new(Severity::Warning, "mesh-coarse", "wide triangles")
                .at(Place::Triangle(7))
                .remedy("more of them"),
            Finding::new(Severity::Note, "photo-clipped", "white").at(pixel),
            Finding::new(Severity::Fatal, "of-the-reader", "said before").at(Place::Line("scene.toml".into(), 2)),
        ];
        let read = &findings[2..];
        let json = serde_json::to_vec(&to_keep(&findings, read).unwrap()).unwrap();
        let back = of_kept(serde_json::from_slice(&json).unwrap(), read);
        assert_eq!(back.as_deref(), Some(&findings[..]));
        assert!(to_keep(&findings, &[]).is_none());
    }
}
