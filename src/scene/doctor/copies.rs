//! Photos that are the same picture under different names.

use crate::image::Image;
use crate::scene::{Photo, View};
use std::collections::BTreeMap;

/// Pixels of a photo that are compared before all of them are.
const SAMPLES: usize = 512;

/// Groups of two and more views whose photos are the same picture, pixel by pixel. Pictures of one colour show nothing and
/// are no copies.
pub(super) fn groups(views: &[View]) -> Vec<Vec<usize>> {
    let mut alike: BTreeMap<(usize, usize, Vec<u32>), Vec<Vec<usize>>> = BTreeMap::new();
    for (index, View { photo, .. }) in views.iter().enumerate() {
        let (width, height) = (photo.width(), photo.height());
        let samples = sampled(photo);
        if samples.chunks_exact(3).all(|pixel| pixel == &samples[..3]) {
            continue;
        }
        let groups = alike.entry((width, height, samples)).or_default();
        match groups.iter_mut().find(|group| same(&views[group[0]].photo, photo)) {
            Some(group) => group.push(index),
            None => groups.push(vec![index]),
        }
    }
    let mut groups: Vec<Vec<usize>> = alike.into_values().flatten().filter(|group| group.len() > 1).collect();
    groups.sort();
    groups
}

/// Pixels spread over a photo, by the bits of their radiance.
fn sampled(photo: &Photo) -> Vec<u32> {
    let (width, count) = (photo.width().max(1), photo.width() * photo.height());
    let step = (count / SAMPLES).max(1);
    let pixels = (0..count).step_by(step).map(|index| photo.radiance(index / width, index % width));
    pixels.flat_map(|radiance| radiance.to_array().map(f32::to_bits)).collect()
}

fn same(one: &Photo, other: &Photo) -> bool {
    fn are<T: PartialEq>(one: &Image<T>, other: &Image<T>) -> bool {
        one.pixels() == other.pixels()
    }
    match (one, other) {
        (Photo::Srgb8(one), Photo::Srgb8(other)) => are(one, other),
        (Photo::MeanOfSrgb8(one), Photo::MeanOfSrgb8(other)) => are(one, other),
        (Photo::Linear16(one), Photo::Linear16(other)) => are(one, other),
        (Photo::Linear32(one), Photo::Linear32(other)) => are(one, other),
        _ => false,
    }
}
