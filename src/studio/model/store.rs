//! What the studio remembers between two starts: recents, theme, layout, the light shelf, the run in progress.
//!
//! One JSON file in the user's configuration folder, written whole or not at all. A file that is damaged is set aside
//! and told of, never an obstacle.

use crate::error::{Error, ErrorKind, Place, Result};
use crate::image::display::DisplaySettings;
use crate::image::{RgbImage, file};
use crate::job::kept::{self, Kept};
use crate::job::time_left::MachinePace;
use crate::studio::stage::Navigation;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Recents kept, at most.
const MOST_RECENTS: usize = 12;

/// The look of the interface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ThemeChoice {
    /// As the system says.
    #[default]
    System,
    /// Light letters on dark ground.
    Dark,
    /// Dark letters on light ground.
    Light,
    /// White on black with strong lines.
    HighContrast,
}

impl ThemeChoice {
    /// All themes with their names.
    pub const NAMED: [(ThemeChoice, &str); 4] = [
        (ThemeChoice::System, "System"),
        (ThemeChoice::Dark, "Dark"),
        (ThemeChoice::Light, "Light"),
        (ThemeChoice::HighContrast, "High contrast"),
    ];

    /// The theme after this one.
    pub fn next(self) -> Self {
        let place = Self::NAMED.iter().position(|(theme, _)| *theme == self).unwrap_or(0);
        Self::NAMED[(place + 1) % Self::NAMED.len()].0
    }
}

/// A scene or run that was opened before.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Recent {
    /// The folder or file.
    pub path: PathBuf,
    /// Whether it is a run folder.
    pub is_run: bool,
}

/// Everything remembered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct Preferences {
    /// The look.
    pub theme: ThemeChoice,
    /// Size of the interface relative to the system's.
    pub zoom: f32,
    /// Opened before, newest first.
    pub recents: Vec<Recent>,
    /// Where new runs go; empty for the folder `Patina runs` in the user's documents.
    pub runs_folder: PathBuf,
    /// HDR maps that were put on the shelf.
    pub lights: Vec<PathBuf>,
    /// How pictures are shown.
    pub display: DisplaySettings,
    /// Size of the window in points.
    pub window_size: [f32; 2],
    /// Arrangement of the panels, as the layout library stores it; empty for the first arrangement.
    pub layout: String,
    /// The same in object mode.
    pub object_layout: String,
    /// How often the window follows a running fit.
    pub follow: Follow,
    /// Whose hand movements the viewport follows.
    pub navigation: Navigation,
    /// How long the parts of a fit take on this machine, as learned from former runs; `None` before the first.
    pub machine_pace: Option<MachinePace>,
    /// Seconds a path of a render took on this machine, as learned from former renders; `None` before the first.
    pub seconds_per_path: Option<f64>,
    /// The run that was in progress when this was written; a later start finds it here after a crash.
    pub running: Option<PathBuf>,
}

/// How often the window follows a running fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Follow {
    /// Curves and maps as they come, as long as that costs the fit little.
    #[default]
    Live,
    /// Every five seconds.
    Seldom,
    /// Only at the end, and when asked.
    Off,
}

impl Default for Preferences {
    fn default() -> Self {
        Preferences {
            theme: ThemeChoice::default(),
            zoom: 1.0,
            recents: Vec::new(),
            runs_folder: PathBuf::new(),
            lights: Vec::new(),
            display: DisplaySettings::default(),
            window_size: [1440.0, 900.0],
            layout: String::new(),
            object_layout: String::new(),
            follow: Follow::Live,
            navigation: Navigation::default(),
            machine_pace: None,
            seconds_per_path: None,
            running: None,
        }
    }
}

impl Preferences {
    /// Puts a path first among the recents.
    pub fn remember(&mut self, path: &Path, is_run: bool) {
        self.recents.retain(|recent| recent.path != path);
        self.recents.insert(0, Recent { path: path.into(), is_run });
        self.recents.truncate(MOST_RECENTS);
    }

    /// Brings numbers of a hand-edited file into their range.
    fn mended(mut self) -> Self {
        self.machine_pace = self.machine_pace.map(MachinePace::within_range);
        if !(0.5..=4.0).contains(&self.zoom) {
            self.zoom = 1.0;
        }
        for (side, least) in self.window_size.iter_mut().zip([640.0, 400.0]) {
            *side = if side.is_finite() { side.clamp(least, 16_384.0) } else { 1000.0 };
        }
        if !self.display.exposure_stops.is_finite() {
            self.display = DisplaySettings::default();
        }
        self
    }
}

/// Where preferences are kept.
#[derive(Clone, Debug)]
pub struct Store {
    path: Option<PathBuf>,
    cache: Option<PathBuf>,
    written: Option<Preferences>,
}

impl Store {
    /// The store of this user; without a home folder nothing is remembered.
    pub fn of_user() -> Self {
        let folders = directories::ProjectDirs::from("", "", "patina");
        let path = folders.as_ref().map(|folders| folders.config_dir().join("studio.json"));
        Store { path, cache: folders.map(|folders| folders.cache_dir().into()), written: None }
    }

    /// A store in a file of one's own, with a folder `patina-cache` beside it; `None` remembers nothing.
    pub fn at(path: Option<PathBuf>) -> Self {
        let cache = path.as_ref().map(|path| path.with_file_name("patina-cache"));
        Store { path, cache, written: None }
    }

    /// Where what opening a scene takes long to make is kept.
    pub fn kept(&self) -> Kept {
        self.cache.clone().map_or_else(Kept::nowhere, kept::in_folder)
    }

    /// Where the small picture of a path that was opened before is kept; `None` where nothing is remembered.
    pub fn thumbnail_path(&self, opened: &Path) -> Option<PathBuf> {
        // FNV-1a: a name that is the same in every build of the program.
        let hash = opened
            .as_os_str()
            .as_encoded_bytes()
            .iter()
            .fold(0xcbf2_9ce4_8422_2325u64, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3));
        Some(self.path.as_ref()?.parent()?.join("thumbnails").join(format!("{hash:016x}.png")))
    }

    /// Keeps a small picture of what was opened. One that cannot be written is missed by nobody.
    pub fn keep_thumbnail(&self, opened: &Path, picture: &RgbImage) {
        let Some(path) = self.thumbnail_path(opened) else { return };
        let is_there = path.parent().is_some_and(|folder| std::fs::create_dir_all(folder).is_ok());
        if is_there {
            let _ = file::write_png_srgb8(&path, &file::srgb8_from_linear(picture, 0.0));
        }
    }

    /// Reads what was remembered. A damaged file is set aside beside the new one and reported.
    pub fn read(&mut self) -> (Preferences, Option<Error>) {
        let Some(path) = &self.path else { return (Preferences::default(), None) };
        let Ok(text) = std::fs::read_to_string(path) else { return (Preferences::default(), None) };
        match serde_json::from_str::<Preferences>(&text) {
            Ok(preferences) => {
                let preferences = preferences.mended();
                self.written = Some(preferences.clone());
                (preferences, None)
            }
            Err(source) => {
                let aside = path.with_extension("damaged.json");
                let _ = std::fs::rename(path, &aside);
                let message = format!("the remembered settings are damaged: {source}");
                let error = Error::new(ErrorKind::Malformed, message).at(Place::File(aside));
                (Preferences::default(), Some(error.remedy("the studio starts afresh; the old file is kept aside")))
            }
        }
    }

    /// Writes what should be remembered, if it changed.
    ///
    /// # Errors
    /// `Unwritable` when the file cannot be written; what it held before is untouched.
    pub fn write(&mut self, preferences: &Preferences) -> Result<()> {
        let Some(path) = &self.path else { return Ok(()) };
        if self.written.as_ref() == Some(preferences) {
            return Ok(());
        }
        let text = serde_json::to_string_pretty(preferences)
            .map_err(|source| Error::new(ErrorKind::Internal, format!("settings cannot be written: {source}")))?;
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|source| Error::writing(folder, source))?;
        }
        crate::files::write_bytes(path, text.as_bytes())?;
        self.written = Some(preferences.clone());
        Ok(())
    }
}

/// Where new runs go when nothing else was chosen.
pub fn usual_runs_folder() -> PathBuf {
    let home = directories::UserDirs::new();
    let documents = home.as_ref().map(|home| home.document_dir().unwrap_or(home.home_dir()).to_path_buf());
    documents.unwrap_or_else(std::env::temp_dir).join("Patina runs")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_remembered_is_read_back_and_a_damaged_file_is_set_aside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep").join("studio.json");
        let mut store = Store::at(Some(path.clone()));
        let mut preferences = store.read().0;
        assert_eq!(preferences, Preferences::default());
        preferences.remember(Path::new("/scene"), false);
        preferences.remember(Path::new("/run"), true);
        preferences.remember(Path::new("/scene"), false);
        store.write(&preferences).unwrap();
        assert_eq!(Store::at(Some(path.clone())).read().0, preferences);
        assert_eq!(preferences.recents.len(), 2);

        crate::files::write_bytes(&path, b"{ \"zoom\": ").unwrap();
        let (fresh, error) = Store::at(Some(path.clone())).read();
        assert_eq!(fresh, Preferences::default());
        assert!(error.is_some() && path.with_extension("damaged.json").is_file());
        crate::files::write_bytes(&path, b"{ \"zoom\": 900, \"window-size\": [1, 1e9] }").unwrap();
        let (mended, error) = Store::at(Some(path)).read();
        assert!(error.is_none() && mended.zoom == 1.0 && mended.window_size == [640.0, 16_384.0]);
    }
}
