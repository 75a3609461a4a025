//! Small pictures as textures, by name.

use crate::image::RgbImage;
use crate::image::display::DisplaySettings;
use eframe::egui::{Color32, ColorImage, Context, TextureHandle, TextureOptions};
use std::collections::HashMap;
use std::sync::Arc;

/// Thumbnails by name: linear, and as textures for the display they were last asked for.
///
/// Make them by [`crate::image::area::thumbnail`], away from the thread of the window when there are many.
#[derive(Default)]
pub struct ThumbnailCache {
    entries: HashMap<String, Entry>,
}

struct Entry {
    linear: Arc<RgbImage>,
    texture: Option<(DisplaySettings, TextureHandle)>,
}

impl ThumbnailCache {
    /// Puts a linear thumbnail in place of what the name had, unless it is the same.
    pub fn keep(&mut self, name: &str, thumbnail: &Arc<RgbImage>) {
        if self.entries.get(name).is_none_or(|known| !Arc::ptr_eq(&known.linear, thumbnail)) {
            self.entries.insert(name.into(), Entry { linear: Arc::clone(thumbnail), texture: None });
        }
    }

    /// The texture of a thumbnail; `None` when there is none of this name, or it has no pixels. It is coloured anew
    /// only when the display changed.
    pub fn texture(&mut self, context: &Context, name: &str, display: &DisplaySettings) -> Option<&TextureHandle> {
        let Entry { linear, texture } = self.entries.get_mut(name)?;
        if linear.pixels().is_empty() {
            return None;
        }
        if texture.as_ref().is_none_or(|(known, _)| known != display) {
            let prepared = display.prepared();
            let colour = |(index, &pixel): (usize, &glam::Vec3)| {
                let (row, column) = (index / linear.width(), index % linear.width());
                if pixel.is_nan() {
                    return Color32::from_gray(90);
                }
                let [red, green, blue] = prepared.bytes(pixel, row as u32, column as u32);
                Color32::from_rgb(red, green, blue)
            };
            let pixels = linear.pixels().iter().enumerate().map(colour).collect();
            let image = ColorImage::new([linear.width(), linear.height()], pixels);
            match &mut *texture {
                Some((known, handle)) => {
                    handle.set(image, TextureOptions::LINEAR);
                    *known = *display;
                }
                none => *none = Some((*display, context.load_texture(name, image, TextureOptions::LINEAR))),
            }
        }
        texture.as_ref().map(|(_, handle)| handle)
    }
}
