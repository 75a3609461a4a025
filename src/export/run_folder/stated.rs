//! What the solver states of its own result: deviations of the maps, what the light is known by, how lobes are shared
//! and what judging views chose. A run of another method has none of these files, which is no error.

use super::RunFolder;
use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::{GreyImage, RgbImage, file};
use crate::material::MaterialMaps;

/// All of them.
pub(super) const STATED_FILES: [&str; 7] = [
    DEVIATION_FILES[0],
    DEVIATION_FILES[1],
    DEVIATION_FILES[2],
    LIGHT_EVIDENCE_FILE,
    LIGHT_SCALE_FILE,
    CHOICES_FILE,
    LOBE_SHARING_FILE,
];
/// Standard deviations of diffuse, specular and roughness map, where the solver made them.
const DEVIATION_FILES: [&str; 3] = ["diffuse_deviation.exr", "specular_deviation.exr", "roughness_deviation.exr"];
/// What each texel of the light is known by, where the solver made it.
const LIGHT_EVIDENCE_FILE: &str = "environment_evidence.exr";
/// How far photos leave the scale of the light open.
const LIGHT_SCALE_FILE: &str = "light_scale.json";
/// What judging views chose for each texel, where the solver was judged.
const CHOICES_FILE: &str = "choices.exr";
/// Number of texels that share each texel's lobe, where the solver made them.
const LOBE_SHARING_FILE: &str = "lobe_sharing.exr";

impl RunFolder {
    /// Writes standard deviations of the maps, in the units of the maps.
    pub fn write_deviations(&self, deviations: &MaterialMaps) -> Result<()> {
        let [diffuse, specular, roughness] = DEVIATION_FILES.map(|name| self.file(name));
        file::write_exr_rgb(&diffuse, &deviations.diffuse)?;
        file::write_exr_rgb(&specular, &deviations.specular)?;
        file::write_exr_grey(&roughness, &deviations.roughness)
    }

    /// Writes what each texel of the light is known by.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write_light_evidence(&self, shares: &RgbImage) -> Result<()> {
        file::write_exr_rgb(&self.file(LIGHT_EVIDENCE_FILE), shares)
    }

    /// Writes the relative standard deviation of the factor that light and reflectance have in common.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_light_scale_deviation(&self, deviation: f64) -> Result<()> {
        // JSON has no infinity: null stands for it.
        let text = serde_json::json!({ "relative_deviation": deviation }).to_string();
        crate::files::write_bytes(&self.file(LIGHT_SCALE_FILE), text.as_bytes())
    }

    /// Reads what [`Self::write_light_scale_deviation`] wrote; `None` where a run does not say.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read_light_scale_deviation(&self) -> Result<Option<f64>> {
        let path = self.file(LIGHT_SCALE_FILE);
        if !path.is_file() {
            return Ok(None);
        }
        let text = self.read_text(LIGHT_SCALE_FILE, "patina fit SCENE -o RUN")?;
        let value: Option<serde_json::Value> = serde_json::from_str(&text).ok();
        match value.as_ref().and_then(|value| value.get("relative_deviation")) {
            Some(serde_json::Value::Null) => Ok(Some(f64::INFINITY)),
            Some(number) if number.is_number() => Ok(number.as_f64()),
            _ => Err(Error::new(ErrorKind::Malformed, "there is no number `relative_deviation`")
                .at(Place::File(path))
                .remedy("delete the file: nothing else depends on it")),
        }
    }

    /// Writes the number of texels that share each texel's lobe.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write_lobe_sharing(&self, sharing: &GreyImage) -> Result<()> {
        file::write_exr_grey(&self.file(LOBE_SHARING_FILE), sharing)
    }

    /// Writes what judging views chose for each texel.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write_choices(&self, choices: &GreyImage) -> Result<()> {
        file::write_exr_grey(&self.file(CHOICES_FILE), choices)
    }

    /// Reads what judging views chose for each texel; `None` where a run does not say.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read_choices(&self) -> Result<Option<GreyImage>> {
        self.file(CHOICES_FILE).is_file().then(|| self.read_grey(CHOICES_FILE)).transpose()
    }

    /// Reads standard deviations of the maps; `None` where a run has none.
    ///
    /// # Errors
    /// Files that cannot be read.
    pub fn read_deviations(&self) -> Result<Option<MaterialMaps>> {
        if DEVIATION_FILES.iter().any(|name| !self.file(name).is_file()) {
            return Ok(None);
        }
        let [diffuse, specular, roughness] = DEVIATION_FILES;
        Ok(Some(MaterialMaps {
            diffuse: self.read_rgb(diffuse)?,
            specular: self.read_rgb(specular)?,
            roughness: self.read_grey(roughness)?,
        }))
    }

    /// Reads what each texel of the light is known by; `None` where a run does not say.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read_light_evidence(&self) -> Result<Option<RgbImage>> {
        self.file(LIGHT_EVIDENCE_FILE).is_file().then(|| self.read_rgb(LIGHT_EVIDENCE_FILE)).transpose()
    }

    /// Reads the number of texels that share each texel's lobe; `None` where a run does not say.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read_lobe_sharing(&self) -> Result<Option<GreyImage>> {
        self.file(LOBE_SHARING_FILE).is_file().then(|| self.read_grey(LOBE_SHARING_FILE)).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_open_scale_of_the_light_is_written_as_null_and_read_as_open() {
        let parent = tempfile::tempdir().unwrap();
        let folder = RunFolder::create(&parent.path().join("run")).unwrap();
        assert_eq!(folder.read_light_scale_deviation().unwrap(), None);
        for (deviation, text) in [(0.25, "0.25"), (f64::INFINITY, "null")] {
            folder.write_light_scale_deviation(deviation).unwrap();
            let written = std::fs::read_to_string(folder.file(LIGHT_SCALE_FILE)).unwrap();
            assert_eq!(written, format!("{{\"relative_deviation\":{text}}}"));
            assert_eq!(folder.read_light_scale_deviation().unwrap(), Some(deviation));
        }
        crate::files::write_bytes(&folder.file(LIGHT_SCALE_FILE), b"{}").unwrap();
        assert_eq!(folder.read_light_scale_deviation().unwrap_err().kind(), ErrorKind::Malformed);
    }
}
