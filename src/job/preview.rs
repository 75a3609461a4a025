//! A path-traced picture on a thread of its own, for a window: the newest request wins.
//!
//! The thread works on a thread pool of its own, never on the global one, and sleeps between tiles so that a fit beside
//! it keeps its pace ([`Preview::set_share`]). Pictures come out through a [`Slot`]: a watcher that is slow misses steps
//! of the refinement, never the last one. A panic in the tracer ends one request with a text; the thread lives on.

use super::newest::Newest;
use super::{Slot, background};
use crate::error::{Error, ErrorKind, Result, text_of_panic};
use crate::image::RgbImage;
use crate::render::passes::{Accumulation, samples_of_next_pass};
use crate::render::picture::PictureSettings;
use crate::render::progressive::PictureTracer;
use crate::render::{Parameters, Surface};
use crate::scene::Camera;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Seconds between two pictures of one request, at least; the first and the last always come.
const PICTURE_INTERVAL: Duration = Duration::from_millis(40);
/// Sleep in pieces of this length, so that a stop is heard.
const NAP: Duration = Duration::from_millis(4);
/// Least share of a core: below it a picture would never come.
const LEAST_SHARE: f32 = 0.02;

/// What is to be drawn.
#[derive(Clone)]
pub struct PreviewRequest {
    /// The surface.
    pub surface: Arc<Surface>,
    /// Maps and light; the light is already turned and scaled.
    pub parameters: Arc<Parameters<f32>>,
    /// The camera, of the size of the picture.
    pub camera: Camera,
    /// How the picture is made; `samples` and `groups` are not read.
    pub settings: PictureSettings,
    /// Samples a pixel at which the refinement ends.
    pub samples_target: usize,
    /// Draw at a quarter and at half of the size first.
    pub coarse_first: bool,
    /// Chosen by who asks; comes back with the picture.
    pub key: u64,
}

/// A picture on its way.
#[derive(Clone, Debug, PartialEq)]
pub struct PreviewPicture {
    /// That of the request.
    pub key: u64,
    /// Linear radiance, of the camera's size.
    pub picture: RgbImage,
    /// Samples a pixel so far; 0 for a picture that was drawn smaller and enlarged.
    pub samples: usize,
    /// Each drawn pixel stands for `factor x factor` pixels; 1 for a whole picture.
    pub factor: usize,
    /// Seconds since the request was taken up.
    pub seconds: f64,
    /// Whether the target is reached.
    pub is_done: bool,
}

/// A request that could not be drawn.
#[derive(Clone, Debug)]
pub struct PreviewFailure {
    /// That of the request.
    pub key: u64,
    /// What happened, with a remedy.
    pub error: Error,
}

/// A function that is called after each picture and failure, on the thread of the preview; it must not wait.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// The thread that draws.
pub struct Preview {
    /// The newest picture.
    pub pictures: Arc<Slot<PreviewPicture>>,
    /// The newest failure.
    pub failures: Arc<Slot<PreviewFailure>>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    requests: Newest<PreviewRequest>,
    /// Bits of the share of one core.
    share: AtomicU32,
    tiles: AtomicUsize,
}

impl Shared {
    fn is_stopped(&self) -> bool {
        self.requests.stop.load(Ordering::Relaxed)
    }
}

impl Preview {
    /// Starts the thread with a pool of `threads` threads (at least 1). `wake` is called after each picture.
    ///
    /// # Errors
    /// `Internal` when the system gives no thread.
    pub fn start(threads: usize, wake: Option<Wake>) -> Result<Self> {
        let threads = threads.max(1);
        let no_thread = |source: String| Error::new(ErrorKind::Internal, format!("cannot start a thread: {source}"));
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|index| format!("patina-preview-{index}"))
            .start_handler(|_| background::give_way())
            .build()
            .map_err(|source| no_thread(source.to_string()))?;
        let shared = Arc::new(Shared { share: AtomicU32::new((threads as f32).to_bits()), ..Default::default() });
        let (pictures, failures) = (Arc::new(Slot::default()), Arc::new(Slot::default()));
        let worker = Worker {
            shared: Arc::clone(&shared),
            pool,
            threads,
            pictures: Arc::clone(&pictures),
            failures: Arc::clone(&failures),
            wake,
        };
        let thread = std::thread::Builder::new()
            .name("patina-preview".into())
            .spawn(move || worker.run())
            .map_err(|source| no_thread(source.to_string()))?;
        Ok(Preview { pictures, failures, shared, thread: Some(thread) })
    }

    /// Draws this next; what is drawn or waiting now is dropped.
    pub fn request(&self, request: PreviewRequest) {
        self.shared.requests.put(request, true);
    }

    /// Drops what is drawn or waiting now. Pictures that are in the slot stay.
    pub fn cancel(&self) {
        self.shared.requests.cancel();
    }

    /// How much of one core to use, from a small share to the number of threads (all of them, as at the start). NaN is
    /// taken for the least share.
    pub fn set_share(&self, share: f32) {
        self.shared.share.store(share.max(LEAST_SHARE).to_bits(), Ordering::Relaxed);
    }

    /// Tiles drawn since the start: a measure of work that does not depend on a clock.
    pub fn tiles_drawn(&self) -> usize {
        self.shared.tiles.load(Ordering::Relaxed)
    }
}

impl Drop for Preview {
    fn drop(&mut self) {
        self.shared.requests.close();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Worker {
    shared: Arc<Shared>,
    pool: rayon::ThreadPool,
    threads: usize,
    pictures: Arc<Slot<PreviewPicture>>,
    failures: Arc<Slot<PreviewFailure>>,
    wake: Option<Wake>,
}

impl Worker {
    fn run(&self) {
        while let Some((request, _)) = self.shared.requests.next(&mut None) {
            let key = request.key;
            let Err(panic) = catch_unwind(AssertUnwindSafe(|| self.draw(&request))) else { continue };
            let message = text_of_panic(&*panic);
            let error = Error::new(ErrorKind::Internal, format!("path tracing ended unexpectedly: {message}"))
                .remedy("internal error (please report); other images can still be rendered");
            self.failures.put(PreviewFailure { key, error });
            self.call_wake();
        }
    }

    fn draw(&self, request: &PreviewRequest) {
        let began = Instant::now();
        let camera = &request.camera;
        let stop = &self.shared.requests.stop;
        let tracer = PictureTracer::new(&request.surface, &request.parameters, request.settings);
        let after_tile = |worked: Duration| {
            self.shared.tiles.fetch_add(1, Ordering::Relaxed);
            self.rest_after(worked);
        };
        let put = |picture: &RgbImage, samples: usize, factor: usize, is_done: bool| {
            let (key, seconds) = (request.key, began.elapsed().as_secs_f64());
            self.pictures.put(PreviewPicture { key, picture: picture.clone(), samples, factor, seconds, is_done });
            self.call_wake();
        };
        let coarse = if request.coarse_first { [4, 2].as_slice() } else { &[] };
        for &factor in coarse {
            let picture = self.pool.install(|| tracer.coarse(camera, 0, factor, stop, &after_tile));
            let Some(picture) = picture else { return };
            put(&picture, 0, factor, false);
        }
        let mut accumulation = Accumulation::new(camera.width, camera.height);
        let target = request.samples_target.max(1);
        let mut last_put: Option<Instant> = None;
        while accumulation.samples() < target {
            let samples = samples_of_next_pass(accumulation.samples(), target);
            if !self.pool.install(|| accumulation.add_pass(&tracer, camera, 0, samples, stop, &after_tile)) {
                return;
            }
            let is_done = accumulation.samples() >= target;
            if is_done || last_put.is_none_or(|then| then.elapsed() > PICTURE_INTERVAL) {
                put(accumulation.picture(), accumulation.samples(), 1, is_done);
                last_put = Some(Instant::now());
            }
        }
    }

    /// Sleeps so long that the threads together use the share of one core. Time that others took from a tile counts as
    /// work: on a busy machine the preview holds back further.
    fn rest_after(&self, worked: Duration) {
        let share = f32::from_bits(self.shared.share.load(Ordering::Relaxed));
        let rest_per_work = self.threads as f32 / share - 1.0;
        if rest_per_work > 0.0 {
            let until = Instant::now() + worked.mul_f32(rest_per_work);
            while !self.shared.is_stopped() {
                let left = until.saturating_duration_since(Instant::now());
                if left.is_zero() {
                    break;
                }
                std::thread::sleep(left.min(NAP));
            }
        }
    }

    fn call_wake(&self) {
        if let Some(wake) = &self.wake {
            wake();
        }
    }
}
