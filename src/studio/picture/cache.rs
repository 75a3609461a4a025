//! What a panel painted, kept as a texture until something changes; and the coarser levels of pictures in use.
//!
//! A picture is known by its `Arc`: a new picture is a new `Arc`, so nothing needs to compare pixels. Only weak
//! references are kept: showing a picture does not keep it alive.

use super::levels::Levels;
use super::overlay::{Compare, LineSpace, Lines, Overlay};
use super::paint::{Inks, Painting};
use super::source::Source;
use super::view::Frame;
use crate::image::display::DisplaySettings;
use crate::image::value_scale::{Palette, ValueScale};
use crate::image::{GreyImage, Image, RgbImage};
use eframe::egui::{Color32, ColorImage, Context, Id, ImageData, TextureHandle, TextureOptions};
use glam::Vec2;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

/// The same allocation, even after its owner is gone.
#[derive(Clone, Debug)]
struct Same<T>(Weak<T>);

impl<T> PartialEq for Same<T> {
    fn eq(&self, other: &Self) -> bool {
        self.0.ptr_eq(&other.0)
    }
}

fn same<T>(shared: &Arc<T>) -> Same<T> {
    Same(Arc::downgrade(shared))
}

#[derive(Clone, Debug, PartialEq)]
enum Pixels {
    Colour(Same<RgbImage>),
    Numbers(Same<GreyImage>),
}

impl Pixels {
    fn of(source: &Source) -> Self {
        match source {
            Source::Colour(image) => Pixels::Colour(same(image)),
            Source::Numbers { image, .. } => Pixels::Numbers(same(image)),
        }
    }

    fn alive(&self) -> bool {
        match self {
            Pixels::Colour(Same(image)) => image.strong_count() > 0,
            Pixels::Numbers(Same(image)) => image.strong_count() > 0,
        }
    }
}

/// How numbers become colours; `None` for pixels that are colours.
type Colours = Option<(ValueScale, Palette)>;
/// Lines, in which space, of which colour.
type LineKey = (Same<Vec<(Vec2, Vec2)>>, LineSpace, Color32);

/// Everything that the pixels of a panel depend on.
#[derive(Clone, Debug, PartialEq)]
struct Key {
    source: (Pixels, Colours),
    other: Option<(Pixels, Colours, Compare)>,
    mask: Option<Same<Image<bool>>>,
    lines: Vec<LineKey>,
    frame: Frame,
    display: DisplaySettings,
    inks: Inks,
}

fn colours_of(source: &Source) -> Colours {
    match source {
        Source::Colour(_) => None,
        Source::Numbers { scale, palette, .. } => Some((*scale, *palette)),
    }
}

/// What a panel shows.
#[derive(Clone)]
pub(super) struct Painted {
    /// On the graphics card; `None` when nothing is visible.
    pub texture: Option<TextureHandle>,
    /// The same pixels here.
    pub pixels: Arc<ColorImage>,
    /// Whether they were made anew.
    pub is_new: bool,
}

#[derive(Clone, Default)]
struct Panel {
    key: Option<Key>,
    texture: Option<TextureHandle>,
    pixels: Arc<ColorImage>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The pixels of a panel: those of the last time when nothing changed.
pub(super) fn painted(
    context: &Context,
    panel: Id,
    source: &Source,
    display: &DisplaySettings,
    overlay: &Overlay,
    frame: Frame,
    inks: Inks,
) -> Painted {
    let panel: Arc<Mutex<Panel>> =
        context.data_mut(|data| data.get_temp_mut_or_default::<Arc<Mutex<Panel>>>(panel).clone());
    let mut panel = lock(&panel);
    let comparison = overlay.comparison.as_ref();
    let key = Key {
        source: (Pixels::of(source), colours_of(source)),
        other: comparison.map(|other| (Pixels::of(&other.other), colours_of(&other.other), other.mode)),
        mask: overlay.mask.as_ref().map(same),
        lines: overlay
            .lines
            .iter()
            .map(|Lines { segments, space, colour }| (same(segments), *space, *colour))
            .collect(),
        frame,
        display: *display,
        inks,
    };
    if panel.key.as_ref() == Some(&key) {
        return Painted { texture: panel.texture.clone(), pixels: panel.pixels.clone(), is_new: false };
    }
    let levels = levels_of(context, source);
    let other = comparison.map(|other| (&other.other, levels_of(context, &other.other), other.mode));
    let painting = Painting {
        source: (source, &levels),
        other: other.as_ref().map(|(other, levels, mode)| (*other, levels, *mode)),
        mask: overlay.mask.as_deref(),
        lines: overlay.lines,
        frame,
        display: *display,
        inks,
    };
    let pixels = Arc::new(painting.pixels());
    if pixels.pixels.is_empty() {
        panel.texture = None;
    } else {
        let data = ImageData::Color(pixels.clone());
        match &mut panel.texture {
            Some(texture) => texture.set(data, TextureOptions::NEAREST),
            none => *none = Some(context.load_texture("picture", data, TextureOptions::NEAREST)),
        }
    }
    panel.pixels = pixels.clone();
    panel.key = Some(key);
    Painted { texture: panel.texture.clone(), pixels, is_new: true }
}

/// The levels of a picture, shared by all panels that show it; those of pictures that are gone are dropped.
fn levels_of(context: &Context, source: &Source) -> Levels {
    type Store = Arc<Mutex<Vec<(Pixels, Levels)>>>;
    let store: Store =
        context.data_mut(|data| data.get_temp_mut_or_default::<Store>(Id::unique("picture levels")).clone());
    let mut store = lock(&store);
    store.retain(|(pixels, _)| pixels.alive());
    let pixels = Pixels::of(source);
    if let Some((_, levels)) = store.iter().find(|(known, _)| *known == pixels) {
        return levels.clone();
    }
    let levels = Levels::of(source);
    store.push((pixels, levels.clone()));
    levels
}
