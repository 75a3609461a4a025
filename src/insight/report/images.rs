//! The pictures of a report; they are shown, not kept.

use crate::image::{GreyImage, Image, RgbImage};
use crate::light::Environment;
use crate::material::MaterialMaps;

/// The pictures of a report, linear. Parts that do not exist are empty or `None`; the page then says so.
#[derive(Clone, Debug, Default)]
pub struct ReportImages<'a> {
    /// Photographs and fits. Hand over those of [`views_to_show`]; more are thinned again.
    pub views: Vec<ViewPictures>,
    /// Exposure at which photographs and fits are shown, in stops; 0 for 8-bit photographs.
    pub exposure_stops: f32,
    /// The fitted maps.
    pub maps: Option<&'a MaterialMaps>,
    /// The true maps.
    pub truth_maps: Option<&'a MaterialMaps>,
    /// In how many photographs a texel was seen, of the maps' size.
    pub times_seen: Option<&'a GreyImage>,
    /// The fitted light.
    pub environment: Option<&'a Environment>,
    /// The true light.
    pub truth_environment: Option<&'a Environment>,
    /// Pictures under other lights.
    pub relit: Vec<RelitStrip>,
    /// What judging views chose for each texel, see [`super::choices`].
    pub choices: Option<&'a GreyImage>,
    /// A page that shows the surface from any side, see [`crate::export::web`].
    pub viewer: Option<String>,
}

/// A photograph and its fit.
#[derive(Clone, Debug)]
pub struct ViewPictures {
    /// Name of the view, as in [`super::data::ViewLine`].
    pub name: String,
    /// Kept out of the fit.
    pub held_out: bool,
    /// The photograph.
    pub photo: RgbImage,
    /// The fit, of the photograph's size.
    pub fit: RgbImage,
    /// Pixels that count in the scores ([`crate::insight::scores::counted_pixels`]); the error is shown there.
    pub counted: Option<Image<bool>>,
}

/// Pictures under one light.
#[derive(Clone, Debug)]
pub struct RelitStrip {
    /// Name of the light, such as `noon_grass_1k`.
    pub light: String,
    /// The light itself, to show beside the pictures.
    pub environment: Option<RgbImage>,
    /// The pictures.
    pub pictures: Vec<RelitPicture>,
}

/// A picture under another light.
#[derive(Clone, Debug)]
pub struct RelitPicture {
    /// What it shows, such as the name of the view.
    pub caption: String,
    /// The picture.
    pub picture: RgbImage,
    /// The true picture, when it is known.
    pub truth: Option<RgbImage>,
}

/// Most views of a kind (held-out, training) that the page shows.
pub const MOST_VIEWS_SHOWN: usize = 24;

/// Which of `count` views to show: all, or [`MOST_VIEWS_SHOWN`] evenly spread ones.
pub fn views_to_show(count: usize) -> Vec<usize> {
    let shown = count.min(MOST_VIEWS_SHOWN);
    (0..shown).map(|index| (2 * index + 1) * count / (2 * shown)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_spread_evenly_and_never_twice() {
        assert_eq!(views_to_show(0), Vec::<usize>::new());
        assert_eq!(views_to_show(5), [0, 1, 2, 3, 4]);
        let many = views_to_show(1000);
        assert_eq!(many.len(), MOST_VIEWS_SHOWN);
        assert!(many.windows(2).all(|pair| pair[1] - pair[0] >= 41) && many[23] < 1000);
    }
}
