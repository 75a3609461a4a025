//! What a fit will need, told before it begins: for whoever sends many to a queue.
//!
//! A sum of what was measured of whole fits on their defaults, on processors of 2.8 GHz (tests/notebook.md: 8 to 1,000 photos,
//! 32,000 to 455,000 triangles, maps of 1024 to 2048 texels a side), with room to spare: a job that asks for too little is
//! killed, one that asks for too much waits. It is no promise: a preset of more steps, another processor or a full machine
//! take longer.

use crate::fit::Suited;
use crate::scene::Scene;
use crate::scene::doctor::Report;

/// Bytes that every fit takes, those of a view in the cache, of a texel with what is fitted and kept beside it, of a triangle
/// with its tree and charts, and of a pixel of a photo.
const BYTES: [f64; 5] = [300e6, 4e6, 480.0, 1000.0, 4.0];
/// Seconds of two threads that every fit takes, those of a view, of a texel and of a triangle.
const SECONDS: [f64; 4] = [40.0, 0.35, 20e-6, 70e-6];
/// The threads that the seconds were measured with.
const THREADS: f64 = 2.0;
/// How much more is asked for than was measured.
const SPARE_MEMORY: f64 = 4.0 / 3.0;
const SPARE_SECONDS: f64 = 2.0;
/// Texels along a side of the maps where it is not known what photos resolve.
const MAP_SIZE: usize = 1024;

/// What to ask a queue for, for one fit on its defaults.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Ask {
    /// Memory in MiB, with a third to spare.
    pub memory_mib: u64,
    /// Seconds of all threads together, twice as many as were measured: divided by the threads, about the seconds of the fit.
    pub processor_seconds: u64,
    /// Width and height of the maps that this is for, in texels.
    pub map_size: usize,
}

impl Ask {
    /// Of a scene that was checked.
    pub fn of(scene: &Scene, report: &Report) -> Self {
        Ask::of_sizes(scene, Suited::to(scene, report).map_size.unwrap_or(MAP_SIZE))
    }

    /// Of a scene and maps of this size.
    pub fn of_sizes(scene: &Scene, map_size: usize) -> Self {
        let pixels: usize = scene.views.iter().map(|view| view.camera.width * view.camera.height).sum();
        Ask::for_sizes(scene.views.len(), pixels, scene.mesh.triangles.len(), map_size)
    }

    /// Seconds that so many threads are expected to take, without the room that is asked for.
    pub fn expected_seconds(&self, threads: usize) -> f64 {
        self.processor_seconds as f64 / SPARE_SECONDS / threads.max(1) as f64
    }

    /// Of so many photos with so many pixels together, so many triangles and maps of this size.
    pub fn for_sizes(views: usize, pixels: usize, triangles: usize, map_size: usize) -> Self {
        let texels = (map_size * map_size) as f64;
        let (views, pixels, triangles) = (views as f64, pixels as f64, triangles as f64);
        let bytes = BYTES[0] + BYTES[1] * views + BYTES[2] * texels + BYTES[3] * triangles + BYTES[4] * pixels;
        let seconds = SECONDS[0] + SECONDS[1] * views + SECONDS[2] * texels + SECONDS[3] * triangles;
        Ask {
            memory_mib: (SPARE_MEMORY * bytes / f64::from(1 << 20)).ceil() as u64,
            processor_seconds: (SPARE_SECONDS * THREADS * seconds).ceil() as u64,
            map_size,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whole fits that were measured: views, pixels of each, triangles, map size, seconds with two threads, megabytes.
    const MEASURED: [(usize, usize, usize, usize, f64, f64); 6] = [
        (32, 728 * 1092, 158_929, 1024, 66.5, 1220.0),
        (8, 1024 * 683, 300_000, 1024, 80.2, 880.0),
        (32, 728 * 1092, 158_929, 2048, 137.9, 2740.0),
        (8, 1024 * 683, 300_000, 2048, 163.5, 2400.0),
        (1000, 768 * 576, 31_964, 1024, 387.0, 6014.0),
        (1000, 768 * 576, 454_854, 1024, 689.0, 5476.0),
    ];

    #[test]
    fn what_is_asked_for_is_enough_for_what_was_measured_and_not_thrice_as_much() {
        for (views, pixels, triangles, map_size, seconds, megabytes) in MEASURED {
            let ask = Ask::for_sizes(views, views * pixels, triangles, map_size);
            let memory = ask.memory_mib as f64 * 1.048_576 / megabytes;
            let time = ask.processor_seconds as f64 / THREADS / seconds;
            assert!((1.0..3.0).contains(&memory), "{memory} of {megabytes} MB: {ask:?}");
            assert!((1.0..3.0).contains(&time), "{time} of {seconds} s: {ask:?}");
        }
    }
}
