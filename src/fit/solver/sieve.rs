//! Which pixels are kept of many photographs, so that memory does not grow with their number.
//!
//! A block of the maps asks some hundred pixels, however many show it ([`super::maps`]). Views are traced one after the
//! other; each pixel draws a lot by its place alone, and a block that has too many asks for better lots from then on, by
//! halves. What is left is an even sample of all views, whichever came first. Where no block has too many, as in scenes of
//! some dozen photos, or where all pixels are few, all stay: diffuse reflectance is solved with all of them at the end.
//! Thinning small photos over coarse maps makes diffuse maps worse, most of all under a strong sun.

use super::observations::Observation;
use crate::math::random::mix;
use crate::render::cached::ViewFootprints;
use glam::Vec2;

/// Texels along the side of a block.
const BLOCK: usize = 4;
/// Most pixels of a block: twice what [`super::maps`] asks, so that a choice is left.
const MOST_OF_BLOCK: u32 = 512;
/// What blocks keep at least where all together have too many: one a texel.
const LEAST_OF_BLOCK: u32 = (BLOCK * BLOCK) as u32;
/// Pixels that stay however many a block has.
const FREE: usize = 1 << 20;
/// Most pixels of all blocks; each takes about 300 bytes.
const MOST: usize = 5 << 20;

/// The pixels that are kept, of the views so far.
pub struct Sieve {
    map_size: usize,
    free: usize,
    most: usize,
    most_of_block: u32,
    /// Per block: times that the share of its pixels that stay was halved.
    halvings: Vec<u8>,
    /// Per block: pixels that stay, exact after a sweep, about right before the next.
    counts: Vec<u32>,
    views: Vec<(ViewFootprints, Vec<Observation>)>,
    /// Pixels that are held, and about how many of them do not stay.
    held: usize,
    stale: usize,
}

impl Sieve {
    /// A sieve over square maps of this many texels along a side.
    pub fn new(map_size: usize) -> Self {
        Sieve::with_most(map_size, MOST_OF_BLOCK, FREE, MOST)
    }

    fn with_most(map_size: usize, most_of_block: u32, free: usize, most: usize) -> Self {
        let blocks = map_size.div_ceil(BLOCK).pow(2);
        Sieve {
            map_size,
            free,
            most,
            most_of_block,
            halvings: vec![0; blocks],
            counts: vec![0; blocks],
            views: Vec::new(),
            held: 0,
            stale: 0,
        }
    }

    /// Adds the next view: its footprints, of which those of pixels that stay are kept, and its pixels, in their order.
    pub fn add(&mut self, footprints: ViewFootprints, pixels: Vec<Observation>) {
        let mut view = (footprints, pixels);
        self.held += sift(&mut view, self.map_size, &self.halvings, &mut self.counts);
        self.views.push(view);
        self.raise();
        if 4 * self.stale > self.held {
            self.sweep();
        }
    }

    /// Whether some block has had too many pixels.
    pub fn has_dropped(&self) -> bool {
        self.halvings.iter().any(|&halvings| halvings > 0)
    }

    /// Whether a pixel of the next view stays if it shows this place of the atlas: where it does not, nothing need be
    /// traced for it.
    pub fn wants(&self, pixel: u32, uv: Vec2) -> bool {
        let size = self.map_size as f32;
        let texel = |at: f32| (at * size).clamp(0.0, size - 1.0) as usize;
        let block = block_of((texel(1.0 - uv.y) * self.map_size + texel(uv.x)) as u32, self.map_size);
        stays(self.views.len() as u32, pixel, self.halvings[block])
    }

    /// The views' footprints, and the pixels of each that stayed.
    pub fn finish(mut self) -> (Vec<ViewFootprints>, Vec<Vec<Observation>>) {
        while self.stale > 0 {
            self.sweep();
            self.raise();
        }
        self.views.into_iter().unzip()
    }

    /// Halves the share of blocks that have too many pixels, and what blocks may have where all have too many.
    fn raise(&mut self) {
        while self.held.saturating_sub(self.stale) > self.free {
            for (count, halvings) in self.counts.iter_mut().zip(&mut self.halvings) {
                while *count > self.most_of_block && *halvings < 32 {
                    *halvings += 1;
                    self.stale += (*count / 2) as usize;
                    *count -= *count / 2;
                }
            }
            if self.held.saturating_sub(self.stale) <= self.most || self.most_of_block <= LEAST_OF_BLOCK {
                return;
            }
            self.most_of_block /= 2;
        }
    }

    /// Drops what does not stay, and counts anew.
    fn sweep(&mut self) {
        self.counts.fill(0);
        self.held = 0;
        for view in &mut self.views {
            self.held += sift(view, self.map_size, &self.halvings, &mut self.counts);
        }
        self.stale = 0;
    }
}

fn block_of(texel: u32, map_size: usize) -> usize {
    let (row, column) = (texel as usize / map_size, texel as usize % map_size);
    row / BLOCK * map_size.div_ceil(BLOCK) + column / BLOCK
}

/// Whether the lot of a pixel is good enough where the share was halved so often.
fn stays(view: u32, pixel: u32, halvings: u8) -> bool {
    (mix(mix(u64::from(view)) ^ u64::from(pixel)) as u32).leading_zeros() >= u32::from(halvings)
}

/// Drops the pixels of a view that do not stay, and their footprints; counts the others, and returns how many they are.
fn sift(
    (footprints, pixels): &mut (ViewFootprints, Vec<Observation>),
    map_size: usize,
    halvings: &[u8],
    counts: &mut [u32],
) -> usize {
    pixels.retain(|pixel| {
        let place = footprints.points[pixel.point as usize].pixel;
        let block = block_of(pixel.texel, map_size);
        let stays = stays(pixel.view, place, halvings[block]);
        counts[block] += u32::from(stays);
        stays
    });
    pixels.shrink_to_fit();
    if pixels.len() != footprints.points.len() {
        footprints.keep_points(pixels.iter().map(|pixel| pixel.point as usize));
        for (point, pixel) in pixels.iter_mut().enumerate() {
            pixel.point = point as u32;
        }
    }
    pixels.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::SequentialRandom;
    use crate::render::cached::ShadingPoint;

    const SIZE: usize = 16;

    /// A view of so many pixels, most of which show the first block.
    fn view(index: u32, pixels: u32) -> (ViewFootprints, Vec<Observation>) {
        let mut random = SequentialRandom::new(u64::from(index) + 5);
        let (mut points, mut texels, mut seen) = (Vec::new(), Vec::new(), Vec::new());
        for pixel in 0..pixels {
            let texel = if pixel % 8 == 0 { random.below(SIZE * SIZE) } else { random.below(4) } as u32;
            let first = texels.len() as u32;
            points.push(ShadingPoint::head_on(pixel, first..first + 1, pixel..pixel + 1));
            texels.push((texel, 1.0));
            let radiance = [pixel as f32; 3];
            seen.push(Observation { view: index, point: pixel, texel, radiance, clipped: false });
        }
        let lit = (0..pixels).map(|pixel| (pixel, 1.0)).collect();
        (ViewFootprints { width: 64, height: 64, points, texels, lit, escaped: Vec::new() }, seen)
    }

    fn sifted(
        views: u32,
        most_of_block: u32,
        free: usize,
        most: usize,
    ) -> (Vec<ViewFootprints>, Vec<Vec<Observation>>, usize) {
        let mut sieve = Sieve::with_most(SIZE, most_of_block, free, most);
        let mut largest = 0;
        for index in 0..views {
            let (footprints, pixels) = view(index, 400);
            sieve.add(footprints, pixels);
            largest = largest.max(sieve.held);
        }
        let (footprints, pixels) = sieve.finish();
        (footprints, pixels, largest)
    }

    #[test]
    fn blocks_with_few_pixels_keep_all_and_others_an_even_sample_of_all_views() {
        let (footprints, pixels, largest) = sifted(200, 512, 0, usize::MAX);
        // Of 80,000 pixels 10,000 show any block: 625 each and 70,000 more the first.
        let mut counts = [0usize; 16];
        for pixel in pixels.iter().flatten() {
            counts[block_of(pixel.texel, SIZE)] += 1;
        }
        assert!(counts.iter().all(|count| (200..=512).contains(count)), "{counts:?}");
        assert!(largest < 14_000, "{largest}");
        // The first block's share is the same in the first half of the views as in the last.
        let first_block = |pixels: &[Vec<Observation>]| {
            pixels.iter().flatten().filter(|pixel| block_of(pixel.texel, SIZE) == 0).count() as f64
        };
        let [early, late] = [first_block(&pixels[..100]), first_block(&pixels[100..])];
        assert!((early - late).abs() < 4.0 * (early + late).sqrt(), "{early} {late}");
        // What is kept still names its own footprint.
        for (footprints, pixels) in footprints.iter().zip(&pixels) {
            assert_eq!(footprints.points.len(), pixels.len());
            for pixel in pixels {
                let point = &footprints.points[pixel.point as usize];
                assert_eq!(point.pixel as f32, pixel.radiance[0]);
                assert_eq!(footprints.texels_of(point), [(pixel.texel, 1.0)]);
                assert_eq!(footprints.lit_of(point), [(point.pixel, 1.0)]);
            }
        }
    }

    #[test]
    fn all_stay_where_no_block_has_too_many() {
        let (_, pixels, _) = sifted(1, 512, 0, usize::MAX);
        assert_eq!(pixels[0], view(0, 400).1);
    }

    #[test]
    fn all_stay_where_all_together_are_few() {
        let (_, pixels, _) = sifted(20, 512, 8000, usize::MAX);
        assert_eq!(pixels.iter().map(Vec::len).sum::<usize>(), 8000);
        let (_, pixels, _) = sifted(20, 512, 7999, usize::MAX);
        assert!(pixels.iter().map(Vec::len).sum::<usize>() < 4000);
    }

    #[test]
    fn what_all_blocks_keep_is_bounded_too() {
        let (_, pixels, largest) = sifted(200, 512, 0, 1000);
        let kept: usize = pixels.iter().map(Vec::len).sum();
        assert!((200..=1000).contains(&kept) && largest < 2500, "{kept} {largest}");
    }
}
