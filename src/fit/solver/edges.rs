//! Pixels that show more than one piece of surface.

use crate::fit::targets::Target;
use crate::math::random::mix;
use crate::render::cached::ViewFootprints;
use crate::scene::{Background, Scene};

/// Most pixels with edges, of all views together.
const MOST_EDGES: usize = 1 << 20;

/// A pixel that shows several pieces of surface, or one beside a black background.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgePixel {
    /// Index among the views of the solver.
    pub view: u32,
    /// The first of its shading points in [`EdgeView::footprints`].
    pub first: u32,
    /// Number of its shading points.
    pub count: u32,
    /// The texel that it covers most.
    pub texel: u32,
    /// Linear radiance of the photo.
    pub radiance: [f32; 3],
    /// The radiance is only known to be at least this.
    pub clipped: bool,
}

/// The edges of a view.
#[derive(Clone, Debug)]
pub struct EdgeView {
    /// Shading points of these pixels alone.
    pub footprints: ViewFootprints,
    /// The pixels.
    pub pixels: Vec<EdgePixel>,
}

impl EdgeView {
    /// The edges among a view's footprints, one of `views`.
    pub fn of(scene: &Scene, target: &Target, index: u32, views: usize, footprints: &ViewFootprints) -> Self {
        let points = &footprints.points;
        let mut pixels = Vec::new();
        let mut kept: Vec<usize> = Vec::new();
        let mut first = 0;
        while first < points.len() {
            let pixel = points[first].pixel;
            let count = points[first..].iter().take_while(|point| point.pixel == pixel).count();
            let range = first..first + count;
            first += count;
            let (radiance, state) = target.at(scene, pixel as usize);
            let escaped = footprints.escaped[pixel as usize];
            let is_known = escaped == 0.0 || (scene.background == Background::Black && escaped < 1.0);
            let is_whole = count == 1 && points[range.start].share >= 0.999;
            if is_whole || !is_known || !state.is_surface() {
                continue;
            }
            let taps = range.clone().flat_map(|at| {
                let point = &points[at];
                footprints.texels_of(point).iter().map(|&(texel, weight)| (texel, point.share * weight))
            });
            let (texel, _) = taps.fold((0, 0.0), |best, next| if next.1 > best.1 { next } else { best });
            pixels.push(EdgePixel {
                view: index,
                first: kept.len() as u32,
                count: count as u32,
                texel,
                radiance: radiance.to_array(),
                clipped: state.is_clipped(),
            });
            kept.extend(range);
        }
        let mut made = EdgeView { footprints: footprints.of_points(kept.into_iter()), pixels };
        made.thin(MOST_EDGES / views.max(1));
        made
    }

    /// Leaves out pixels by lot, so that about `most` stay.
    fn thin(&mut self, most: usize) {
        let step = self.pixels.len().div_ceil(most.max(1)) as u64;
        if step < 2 {
            return;
        }
        let points = &self.footprints.points;
        self.pixels.retain(|own| mix(u64::from(points[own.first as usize].pixel)).is_multiple_of(step));
        let mut kept: Vec<usize> = Vec::new();
        for own in &mut self.pixels {
            let first = own.first as usize;
            own.first = kept.len() as u32;
            kept.extend(first..first + own.count as usize);
        }
        self.footprints = self.footprints.of_points(kept.into_iter());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::render::cached::ShadingPoint;
    use crate::scene::Photo;
    use crate::scene::demo::{DemoSettings, build};
    use glam::Vec3;

    /// Pixels of four kinds, one after the other: filled by one piece, two pieces, one beside the background, background.
    fn view(width: usize) -> ViewFootprints {
        let mut made = ViewFootprints {
            width,
            height: 1,
            points: Vec::new(),
            texels: Vec::new(),
            lit: Vec::new(),
            escaped: Vec::new(),
        };
        for pixel in 0..width as u32 {
            let shares: &[f32] = [&[1.0][..], &[0.3, 0.7], &[0.6], &[]][pixel as usize % 4];
            for (which, &share) in shares.iter().enumerate() {
                let first = made.texels.len() as u32;
                made.texels.push((pixel + which as u32, 1.0));
                made.lit.push((0, 1.0));
                let point = ShadingPoint::head_on(pixel, first..first + 1, first..first + 1);
                made.points.push(ShadingPoint { share, ..point });
            }
            made.escaped.push(1.0 - shares.iter().sum::<f32>());
        }
        made.escaped.iter_mut().for_each(|share| *share = if share.abs() < 1e-6 { 0.0 } else { *share });
        made
    }

    #[test]
    fn edges_count_where_all_that_they_show_is_known() {
        let mut scene = build(&DemoSettings {
            views: 1,
            held_out: 0,
            width: 16,
            height: 12,
            map_size: 64,
            seed: 1,
            ..Default::default()
        })
        .unwrap()
        .scene;
        let width = scene.views[0].camera.width;
        let footprints = view(width);
        let kinds = |scene: &Scene| -> Vec<u32> {
            let made = EdgeView::of(scene, &Target::new(scene, 0, 0), 0, 1, &footprints);
            // What is kept names its own pieces, and the texel that it covers most.
            for own in &made.pixels {
                let points = &made.footprints.points[own.first as usize..(own.first + own.count) as usize];
                let pixel = points[0].pixel;
                assert!(points.iter().all(|point| point.pixel == pixel));
                let heaviest = if pixel % 4 == 1 { pixel + 1 } else { pixel };
                assert_eq!((own.texel, own.count as usize), (heaviest, points.len()));
            }
            let mut kinds: Vec<u32> =
                made.pixels.iter().map(|own| made.footprints.points[own.first as usize].pixel % 4).collect();
            kinds.sort_unstable();
            kinds.dedup();
            kinds
        };
        let states = Image::filled(width, scene.views[0].camera.height, crate::scene::PixelState::Surface);
        scene.views[0].states = states;
        scene.views[0].photo = Photo::Linear32(Image::filled(width, scene.views[0].camera.height, Vec3::ONE));
        scene.background = Background::Environment;
        assert_eq!(kinds(&scene), [1]);
        scene.background = Background::Black;
        assert_eq!(kinds(&scene), [1, 2]);
        scene.views[0].states.pixels_mut().fill(crate::scene::PixelState::Ignored);
        assert!(kinds(&scene).is_empty());
    }

    #[test]
    fn of_too_many_edges_an_even_share_stays() {
        let footprints = view(4000);
        let pixels: Vec<EdgePixel> = (0..1000)
            .map(|k| EdgePixel { view: 0, first: 1 + 4 * k, count: 2, texel: k, radiance: [1.0; 3], clipped: false })
            .collect();
        let mut made = EdgeView { footprints, pixels };
        made.thin(250);
        assert!((180..320).contains(&made.pixels.len()), "{}", made.pixels.len());
        assert_eq!(made.footprints.points.len(), 2 * made.pixels.len());
        for own in &made.pixels {
            assert!(made.footprints.points[own.first as usize].pixel % 4 == 1);
        }
    }
}
