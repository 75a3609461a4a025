//! `convention.txt` of an export: what each number means, and what was lost.

use super::asset::Asset;
use super::asset::reflectance::MetalSplit;
use super::whole_folder::FIRST_LINE;
use crate::material::LobeModel;
use crate::material::lobe::nearest::ggx_of_blinn_phong;
use crate::math::statistics::quantile;

/// What an export lost, in numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Losses {
    /// Sentences, without a full stop.
    pub sentences: Vec<String>,
}

impl Losses {
    /// What writing GGX in place of the fitted lobe loses, over the widths of the map.
    pub fn of_lobe(asset: &Asset) -> Self {
        if !asset.has_lobe || asset.lobe == LobeModel::Ggx {
            return Losses::default();
        }
        let roughness = asset.maps.roughness.pixels();
        let step = (roughness.len() / 65_536).max(1);
        let widths: Vec<f64> = roughness.iter().step_by(step).map(|&r| f64::from(r.max(0.0)).sqrt()).collect();
        let parts = [0.05, 0.5, 0.95].map(|share| {
            let width = quantile(&widths, share);
            let ggx = ggx_of_blinn_phong(width);
            format!("{width:.3} -> {:.3} ({:.0} %)", ggx.width, 100.0 * ggx.relative_error)
        });
        let sentence = format!(
            "the lobe is written as the GGX lobe nearest to it in squared difference; microfacet width of the narrowest \
             twentieth, the middle and the widest twentieth of the texels, and in brackets the difference over the lobe: {}",
            parts.join(", ")
        );
        Losses { sentences: vec![sentence] }
    }

    /// The same with what raising the diffuse map lost.
    pub fn and_held(mut self, held_share: f64) -> Self {
        if held_share > 0.0 {
            self.sentences.push(format!(
                "{:.2} % of the texels would need a base colour above 1 and were held there: they come out darker",
                100.0 * held_share
            ));
        }
        self
    }

    /// The same with what base colour and metalness lost.
    pub fn and_split(mut self, split: &MetalSplit) -> Self {
        self.sentences.push(format!(
            "base colour and metalness stand for two reflectances: root mean squared error of F0 {:.4}, of the diffuse \
             reflectance {:.4}",
            split.error_f0, split.error_diffuse
        ));
        self
    }

    /// The same with one more sentence.
    pub fn and(mut self, sentence: impl Into<String>) -> Self {
        self.sentences.push(sentence.into());
        self
    }
}

/// The sheet of one format: what the files are, what the numbers mean, what was lost.
pub fn of_format(title: &str, files: &str, losses: &Losses) -> String {
    let mut text = format!("{FIRST_LINE}\n\n{title}\n\nFILES AND NUMBERS\n");
    files.lines().for_each(|line| text.push_str(&format!("{}\n", indented(line))));
    text.push_str("\nWHAT WAS LOST\n");
    if losses.sentences.is_empty() {
        text.push_str("  Nothing but the digits that the files do not hold.\n");
    }
    losses.sentences.iter().for_each(|sentence| text.push_str(&wrapped(sentence)));
    text
}

/// What other programs made of the demo, as a section of a format's sheet.
pub fn of_proof(sentence: &str) -> String {
    format!("\nPROOF\n{}", wrapped(sentence))
}

/// The sheet of the whole export.
pub fn of_export(asset: &Asset, folders: &[&str]) -> String {
    let [distribution, shadowing] = asset.lobe.formulas();
    let lobe = match asset.has_lobe {
        true => format!(
            "\
The fitted model
  f = diffuse / pi + D F G / (4 (n.i)(n.o)),  diffuse not reduced by F
  {distribution}
  F  Schlick,  F0 + (1 - F0)(1 - h.o)^5
  {shadowing}
Each folder says which of its numbers stand for these, and what its renderer computes instead.
"
        ),
        false => "The surface was fitted without a specular lobe: f = diffuse / pi.\n".into(),
    };
    let sun = match asset.light.as_ref().map(|light| &light.sun) {
        None => "The run has no light: environments are missing from this export.\n".into(),
        Some(None) => "The light has no texels that clearly dominate: no sun was written.\n".into(),
        Some(Some(sun)) => format!(
            "The light has a sun towards ({:.3}, {:.3}, {:.3}), irradiance {:.3} {:.3} {:.3} facing it, {:.4} sr.\n",
            sun.towards.x,
            sun.towards.y,
            sun.towards.z,
            sun.irradiance.x,
            sun.irradiance.y,
            sun.irradiance.z,
            sun.solid_angle
        ),
    };
    format!(
        "{FIRST_LINE}\n\nFolders: {}. Each holds a convention.txt of its own.\n\n{lobe}\n{sun}\n\
         World: right-handed, +y up, lengths in the units of the mesh.\n\
         Radiance is linear (Rec. 709), in the unit of the photographs; only ratios are meaningful.\n\
         Maps are filled past the borders of their charts with the nearest texel inside.\n",
        folders.join(", ")
    )
}

fn indented(line: &str) -> String {
    if line.is_empty() { String::new() } else { format!("  {line}") }
}

/// A sentence as lines of at most 100 characters.
fn wrapped(sentence: &str) -> String {
    let mut text = String::from("  *");
    let mut length = 3;
    for word in sentence.split_whitespace() {
        if length + 1 + word.chars().count() > 100 {
            text.push_str("\n   ");
            length = 3;
        }
        text.push(' ');
        text.push_str(word);
        length += 1 + word.chars().count();
    }
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use super::super::asset::tests::small_asset;
    use super::*;

    #[test]
    fn a_sheet_says_what_was_lost_in_lines_that_fit() {
        let asset = small_asset(true);
        let losses = Losses::of_lobe(&asset).and_held(0.125).and("the sun was left out");
        let text = of_format("GLB", "a.glb  all of it\n  more of it", &losses);
        assert!(text.starts_with(FIRST_LINE) && text.contains("12.50 % of the texels"), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
        // Each width and its error are those of the conversion.
        let middle = ggx_of_blinn_phong(0.5f64.sqrt()).width;
        assert!(middle > 0.2 && text.contains("->"));
        assert_eq!(Losses::of_lobe(&small_asset(false)), Losses::default());
        let whole = of_export(&asset, &["glb", "usd"]);
        assert!(whole.starts_with(FIRST_LINE) && whole.contains("has a sun towards"));
        let mut dark = asset;
        dark.light = None;
        assert!(of_export(&dark, &["glb"]).contains("no light"));
    }
}
