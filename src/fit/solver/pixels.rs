//! Whole pixels as evidence: with all pieces of surface they show, edges included.
//!
//! Blocks and tiles look at pixels that one piece of surface fills ([`super::observations`]). What is narrower than a pixel,
//! a horn, a railing, the rim of a chart, is seen in no such pixel; here those count too that show several pieces, and
//! background beside surface where that is black and so known exactly. What lies behind a photograph's silhouettes is not.

use super::edges::EdgePixel;
use super::scene::SolverScene;
use crate::render::cached::{ShadingPoint, ViewFootprints};

/// A piece of surface under a pixel.
#[derive(Clone, Copy)]
pub struct Piece<'a> {
    /// The footprints that hold its texels.
    pub footprints: &'a ViewFootprints,
    /// Where and how it is seen.
    pub point: &'a ShadingPoint,
}

/// A pixel of a photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pixel {
    /// Index among the views of the solver.
    pub view: u32,
    /// Linear radiance of the photo.
    pub radiance: [f32; 3],
    /// The radiance is only known to be at least this.
    pub clipped: bool,
}

/// All pixels: those that one piece fills, sorted by texel, and after them those with edges, sorted as well.
pub struct Pixels<'a> {
    scene: &'a SolverScene,
    /// Observations that one piece fills.
    whole: Vec<u32>,
    edges: Vec<EdgePixel>,
    /// Where the pieces of each pixel with edges end, among their pieces.
    ends: Vec<u32>,
}

impl<'a> Pixels<'a> {
    /// The pixels of a scene.
    pub fn of(scene: &'a SolverScene) -> Self {
        let mut edges: Vec<EdgePixel> = scene.edges.iter().flat_map(|view| view.pixels.iter().copied()).collect();
        edges.sort_by_key(|own| (own.texel, own.view, own.first));
        Self::made(scene, (0..scene.observations.list.len() as u32).collect(), edges)
    }

    /// One in `stride` chunks of these pixels, each of `chunk` side by side on the surface, and which they are of these.
    pub fn sampled(&self, chunk: usize, stride: usize) -> (Self, Vec<usize>) {
        let is_taken = |index: &usize| (index / chunk).is_multiple_of(stride);
        let whole: Vec<usize> = (0..self.whole()).filter(is_taken).collect();
        let edges: Vec<usize> = (0..self.edges.len()).filter(is_taken).collect();
        let made = Self::made(
            self.scene,
            whole.iter().map(|&index| self.whole[index]).collect(),
            edges.iter().map(|&index| self.edges[index]).collect(),
        );
        (made, whole.into_iter().chain(edges.into_iter().map(|index| self.whole() + index)).collect())
    }

    fn made(scene: &'a SolverScene, whole: Vec<u32>, edges: Vec<EdgePixel>) -> Self {
        let ends = edges.iter().scan(0, |end, own| {
            *end += own.count;
            Some(*end)
        });
        Pixels { ends: ends.collect(), whole, edges, scene }
    }

    /// Number of pixels.
    pub fn count(&self) -> usize {
        self.whole() + self.edges.len()
    }

    /// Number of views.
    pub fn views(&self) -> usize {
        self.scene.views.len()
    }

    /// Number of pixels that one piece fills: the first ones.
    pub fn whole(&self) -> usize {
        self.whole.len()
    }

    /// A pixel.
    #[inline]
    pub fn pixel(&self, index: usize) -> Pixel {
        match index.checked_sub(self.whole()) {
            None => {
                let own = &self.scene.observations.list[self.whole[index] as usize];
                Pixel { view: own.view, radiance: own.radiance, clipped: own.clipped }
            }
            Some(edge) => {
                let own = &self.edges[edge];
                Pixel { view: own.view, radiance: own.radiance, clipped: own.clipped }
            }
        }
    }

    /// The texel that a pixel covers most.
    pub fn texel(&self, index: usize) -> u32 {
        match index.checked_sub(self.whole()) {
            None => self.scene.observations.list[self.whole[index] as usize].texel,
            Some(edge) => self.edges[edge].texel,
        }
    }

    /// The pixels whose first texel is in this range.
    pub fn of_texels(&self, texels: std::ops::Range<usize>) -> impl Iterator<Item = usize> {
        let first = |texel: usize, mut low: usize, mut high: usize| {
            while low < high {
                let middle = low.midpoint(high);
                if (self.texel(middle) as usize) < texel { low = middle + 1 } else { high = middle }
            }
            low
        };
        let (whole, count) = (self.whole(), self.count());
        let within = |low, high| first(texels.start, low, high)..first(texels.end, low, high);
        within(0, whole).chain(within(whole, count))
    }

    /// The pieces of a pixel among all pieces.
    #[inline]
    pub fn pieces(&self, index: usize) -> std::ops::Range<usize> {
        let whole = self.whole();
        match index.checked_sub(whole) {
            None => index..index + 1,
            Some(edge) => {
                let end = self.ends[edge];
                whole + (end - self.edges[edge].count) as usize..whole + end as usize
            }
        }
    }

    /// A piece of a pixel, by its place among the pixel's.
    #[inline]
    pub fn piece(&self, index: usize, which: usize) -> Piece<'a> {
        match index.checked_sub(self.whole()) {
            None => {
                let own = &self.scene.observations.list[self.whole[index] as usize];
                let footprints = &self.scene.footprints[own.view as usize];
                Piece { footprints, point: &footprints.points[own.point as usize] }
            }
            Some(edge) => {
                let own = &self.edges[edge];
                let footprints = &self.scene.edges[own.view as usize].footprints;
                Piece { footprints, point: &footprints.points[own.first as usize + which] }
            }
        }
    }
}
