//! Light transport by which a window relights a surface.
//!
//! Most points see all of a hat or nothing of it, so the bytes are deflated: a tenth is left of them.

use super::Kept;
use super::content::{add_fields, add_mesh};
use crate::files::digest::Digest;
use crate::files::packed::{Packer, Unpacker};
use crate::render::Surface;
use crate::render::cached::bounce::BounceMatrix;
use crate::render::cached::light_basis::LightBasis;
use crate::render::cached::surroundings::Surroundings;
use crate::render::cached::traced::Traced;
use crate::render::cached::visibility::Visibility;
use crate::render::cached::{CachedSettings, CachedTransport, VisibilityGrid};
use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use std::io::{Read, Write};
use std::sync::atomic::AtomicBool;

pub(super) const KIND: &str = "transport";

/// The cache of a surface for lights of a size, as [`CachedTransport::build`] makes it, from disk where it was made before;
/// `None` when `stop` was raised.
pub fn transport(
    surface: &Surface,
    settings: CachedSettings,
    light_size: (usize, usize),
    kept: &Kept,
    stop: &AtomicBool,
) -> Option<CachedTransport> {
    let key = key_of(surface, &settings, light_size, kept);
    CachedTransport::of_traced(surface, settings, light_size, |places| {
        if let Some(traced) = key.and_then(|key| unpacked(&kept.read(KIND, key)?, &settings, places)) {
            return Some(traced);
        }
        let traced = Traced::trace(surface, &settings, places, stop)?;
        if let Some((key, bytes)) = key.zip(packed(&traced)) {
            kept.write(KIND, key, &bytes);
        }
        Some(traced)
    })
}

fn key_of(surface: &Surface, settings: &CachedSettings, light_size: (usize, usize), kept: &Kept) -> Option<Digest> {
    let mut key = kept.key(KIND)?;
    add_fields(&mut key, &(settings, light_size));
    add_mesh(&mut key, surface.mesh());
    Some(key.finish())
}

pub(super) fn packed(traced: &Traced) -> Option<Vec<u8>> {
    let Traced { visibility, bounces, surroundings, bounce_seconds: _ } = traced;
    let mut packer = Packer::default();
    packer.put(&[visibility.rays]).put(&visibility.shares);
    if let Some((offsets, targets)) = bounces.as_ref().map(BounceMatrix::rows) {
        packer.put(offsets).put(targets);
    }
    if let Some((offsets, hidings)) = surroundings.as_ref().map(Surroundings::lists) {
        packer.put(offsets).put(hidings);
    }
    let mut deflated = DeflateEncoder::new(Vec::new(), Compression::fast());
    deflated.write_all(&packer.finish()).ok()?;
    deflated.finish().ok()
}

/// `None` where the bytes are not what is traced with these settings for this grid.
pub(super) fn unpacked(
    bytes: &[u8],
    settings: &CachedSettings,
    (grid, basis): (&VisibilityGrid, &LightBasis),
) -> Option<Traced> {
    let (points, stride) = (grid.points.len(), basis.padded());
    // No more than there can be: shares, and each ray and each hat with one number or two.
    let most = points.checked_mul(stride + 16 + 4 * settings.rays_traced() + 8 * basis.count())? + 1024;
    let mut whole = Vec::new();
    DeflateDecoder::new(bytes).take(most as u64).read_to_end(&mut whole).ok()?;
    let mut parts = Unpacker::new(&whole);
    let ([rays], shares): ([u64; 1], Vec<u8>) = (parts.take()?.try_into().ok()?, parts.take()?);
    if shares.len() != points * stride {
        return None;
    }
    let visibility = Visibility { stride, shares, rays };
    let mut traced = Traced { visibility, bounces: None, surroundings: None, bounce_seconds: 0.0 };
    if settings.max_bounces > 1 {
        traced.bounces = Some(BounceMatrix::of_rows(parts.take()?, parts.take()?, settings.rays_traced(), points)?);
    }
    if settings.has_surroundings() {
        let cells = (basis, settings.surface_side(basis));
        traced.surroundings = Some(Surroundings::of_lists(parts.take()?, parts.take()?, cells, points)?);
    }
    parts.end()?;
    Some(traced)
}
