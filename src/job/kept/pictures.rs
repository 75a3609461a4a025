//! The pictures of the built-in scene.

use super::Kept;
use super::content::{add_fields, add_mesh};
use crate::error::Result;
use crate::files::digest::Digest;
use crate::files::packed::{Packer, Unpacker};
use crate::image::{Image, RgbImage};
use crate::scene::{Camera, Photo, Scene};
use glam::Vec3;
use std::fmt::Debug;

pub(super) const KIND: &str = "pictures";

/// Fills the photographs and relit pictures of a scene in code that was made with these settings: from disk where they were
/// made before, else by `make`, which is given nothing but the scene.
///
/// # Errors
/// As of `make`.
pub fn photograph(
    scene: &mut Scene,
    settings: &impl Debug,
    kept: &Kept,
    make: impl FnOnce(&mut Scene) -> Result<()>,
) -> Result<()> {
    let key = key_of(scene, settings, kept);
    let pictures = key.and_then(|key| unpacked(&kept.read(KIND, key)?, scene));
    if let Some((photos, relit)) = pictures {
        for (view, photo) in photos.into_iter().enumerate() {
            scene.set_photo(view, photo)?;
        }
        if let Some(relight) = scene.truth.as_mut().and_then(|truth| truth.relight.as_mut()) {
            relight.pictures = relit;
        }
        return Ok(());
    }
    make(scene)?;
    if let Some((key, bytes)) = key.zip(packed(scene)) {
        kept.write(KIND, key, &bytes);
    }
    Ok(())
}

fn key_of(scene: &Scene, settings: &impl Debug, kept: &Kept) -> Option<Digest> {
    let mut key = kept.key(KIND)?;
    let cameras: Vec<&Camera> = scene.views.iter().map(|view| &view.camera).collect();
    add_fields(&mut key, &(settings, cameras));
    add_mesh(&mut key, &scene.mesh);
    Some(key.finish())
}

/// `None` where a pixel is no evidence: of a rendered picture every one is.
pub(super) fn packed(scene: &Scene) -> Option<Vec<u8>> {
    let mut packer = Packer::default();
    for view in &scene.views {
        let Photo::Linear32(photo) = &view.photo else { return None };
        if view.states.pixels().iter().any(|state| !state.is_surface() || state.is_clipped()) {
            return None;
        }
        packer.put(photo.pixels());
    }
    let relit = relit_pictures(scene);
    packer.put(&[relit.len() as u64]);
    for (view, picture) in relit {
        packer.put(&[*view as u64]).put(picture.pixels());
    }
    Some(packer.finish())
}

fn relit_pictures(scene: &Scene) -> &[(usize, RgbImage)] {
    let relight = scene.truth.as_ref().and_then(|truth| truth.relight.as_ref());
    relight.map_or(&[], |relight| &relight.pictures)
}

/// Photos, and relit pictures with the indices of their views.
type Pictures = (Vec<RgbImage>, Vec<(usize, RgbImage)>);

/// `None` where the bytes are not the pictures of these cameras.
pub(super) fn unpacked(bytes: &[u8], scene: &Scene) -> Option<Pictures> {
    let mut parts = Unpacker::new(bytes);
    let picture = |parts: &mut Unpacker<'_>, view: usize| {
        let Camera { width, height, .. } = scene.views.get(view)?.camera;
        let pixels: Vec<Vec3> = parts.take()?;
        let is_whole = pixels.len() == width * height && pixels.iter().all(|pixel| pixel.is_finite());
        is_whole.then(|| Image::from_pixels(width, height, pixels))
    };
    let photos = (0..scene.views.len()).map(|view| picture(&mut parts, view)).collect::<Option<Vec<_>>>()?;
    let number = |parts: &mut Unpacker<'_>| usize::try_from(*parts.take::<u64>()?.first()?).ok();
    let mut relit = Vec::new();
    for _ in 0..number(&mut parts)? {
        let view = number(&mut parts)?;
        relit.push((view, picture(&mut parts, view)?));
    }
    parts.end()?;
    Some((photos, relit))
}
