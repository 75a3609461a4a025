//! The part that changes: what is uploaded, the targets, and when the scene is drawn anew.
//!
//! A frame that differs from the last only in exposure, curve, photo or wipe of the photo is not drawn again, only made a
//! picture of anew; one that does not differ is the last picture, copied into the window.

mod binding;
mod drawing;

use super::content::{CoveredTexels, StageFrame, StageLight};
use super::light::{self, PreparedLight};
use super::mesh::GpuMesh;
use super::overlay::Overlay;
use super::pipelines::Pipelines;
use super::slot::{Slot, Speed};
use super::texels::{CLAY, GpuTexture, MATT, Maker};
use super::uniforms::{ScreenUniform, Sizes, ViewUniform};
use super::variants::{BehindVariant, MeshVariant, ScreenVariant};
use crate::error::Finding;
use crate::image::{GreyImage, Image, RgbImage};
use crate::light::Environment;
use crate::material::{LobeModel, MaterialMaps};
use crate::scene::Mesh;
use crate::studio::copy::Copy;
use crate::studio::repaint::was_lost;
use drawing::Targets;
use eframe::{egui, wgpu};
use glam::Vec3;
use std::sync::Arc;

/// Images of at most this many texels are uploaded within a frame, the rest on another thread.
const TEXELS_AT_ONCE: usize = 256 * 256;

/// Lights that were shown before and are shown again at once: who compares goes back and forth.
const LIGHTS_KEPT: usize = 8;

/// What the stage did, for the app to show and for tests.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StageStatus {
    /// How often the scene was drawn; frames that were only shown do not count.
    pub scenes_drawn: u64,
    /// How many frames were shown.
    pub frames_shown: u64,
    /// Something newer is being uploaded.
    pub is_uploading: bool,
    /// A newer light is being blurred.
    pub is_light_uploading: bool,
    /// Seconds that threads spent on maps and lights so far.
    pub upload_seconds: f64,
    /// What the user should know of what is shown.
    pub findings: Vec<Finding>,
}

type MeshKey = (Arc<Mesh>, Option<Arc<Vec<[f32; 4]>>>);
type MapsKey = (Arc<MaterialMaps>, Option<Arc<CoveredTexels>>);
/// A light, and the microfacets that it is blurred by.
type LightKey = (Arc<Environment>, LobeModel);

/// A light on the graphics adapter.
struct GpuLight {
    map: GpuTexture,
    layers: GpuTexture,
    reflectances: GpuTexture,
}

impl GpuLight {
    fn new(maker: &Maker, light: &PreparedLight) -> Self {
        GpuLight {
            map: maker.table("stage light", &light.mirror),
            layers: maker.layers("stage blurred light", &light.layers),
            reflectances: maker.table("stage reflectance", light.reflectances),
        }
    }
}

/// What stands in for what is not there.
struct Missing {
    diffuse: GpuTexture,
    specular: GpuTexture,
    black: GpuTexture,
    light: GpuLight,
}

/// Everything the stage keeps on the graphics adapter.
pub(super) struct StageRenderer {
    maker: Maker,
    pipelines: Pipelines,
    copy: Copy,
    view_buffer: wgpu::Buffer,
    screen_buffer: wgpu::Buffer,
    missing: Missing,
    mesh: Slot<MeshKey, GpuMesh>,
    maps: Slot<MapsKey, (GpuTexture, GpuTexture, Vec<Finding>)>,
    quantity: Slot<Arc<GreyImage>, GpuTexture>,
    photos: Slot<MapsKey, GpuTexture>,
    lights: [Slot<LightKey, GpuLight>; 2],
    photo: Slot<Arc<RgbImage>, GpuTexture>,
    traced: Slot<Arc<RgbImage>, GpuTexture>,
    overlay: Overlay,
    targets: Option<Targets>,
    drawn: Option<(ViewUniform, MeshVariant, BehindVariant)>,
    /// What the picture was made by, and of.
    pictured: Option<(ScreenUniform, ScreenVariant)>,
    is_shown: bool,
    /// A frame was recorded, and the window's pass, which comes after it, was not yet.
    is_on_its_way: bool,
    status: StageStatus,
}

impl StageRenderer {
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, window_format: wgpu::TextureFormat) -> Self {
        let maker = Maker { device: device.clone(), queue: queue.clone() };
        let uniform = |label, size: usize| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let dark = Image::filled(1, 1, Vec3::ZERO);
        let layers = vec![dark.clone(); 1 + light::WIDTHS];
        let reflectances = light::reflectance_table(LobeModel::default());
        let missing = Missing {
            diffuse: maker.one("stage clay", CLAY),
            specular: maker.one("stage matt", MATT),
            black: maker.one("stage nothing", [0.0; 4]),
            light: GpuLight::new(&maker, &PreparedLight { mirror: dark, layers, reflectances }),
        };
        StageRenderer {
            pipelines: Pipelines::new(device),
            copy: Copy::new(device, window_format),
            view_buffer: uniform("stage view", size_of::<ViewUniform>()),
            screen_buffer: uniform("stage screen", size_of::<ScreenUniform>()),
            missing,
            mesh: Slot::default(),
            maps: Slot::default(),
            quantity: Slot::default(),
            photos: Slot::default(),
            lights: [Slot::keeping(LIGHTS_KEPT), Slot::keeping(LIGHTS_KEPT)],
            photo: Slot::default(),
            traced: Slot::default(),
            overlay: Overlay::default(),
            targets: None,
            drawn: None,
            pictured: None,
            is_shown: false,
            is_on_its_way: false,
            status: StageStatus::default(),
            maker,
        }
    }

    pub fn status(&self) -> &StageStatus {
        &self.status
    }

    /// Brings everything up to the frame and records the drawing of the scene where it changed.
    pub fn prepare(
        &mut self,
        frame: &StageFrame,
        screen: [u32; 2],
        pixels_per_point: f32,
        context: &egui::Context,
        encoder: &mut wgpu::CommandEncoder,
    ) {
        self.is_shown = !screen.contains(&0);
        if !self.is_shown {
            return;
        }
        // What was recorded for a frame that never came to be drawn is recorded again.
        if std::mem::replace(&mut self.is_on_its_way, true) || was_lost(context) {
            (self.drawn, self.pictured) = (None, None);
        }
        let sizes = self.sizes(screen, frame.look.resolution_scale, pixels_per_point);
        let (mut changed, pictures_changed) = self.follow_content(frame, context);
        let content = &frame.content;
        changed |= self.overlay.follow(
            &self.maker.device,
            &self.maker.queue,
            &self.pipelines,
            (&content.cameras, content.frustum_depth, frame.eye.position_in_world(), frame.look.accent),
        );
        changed |= self.follow_size(&sizes);
        let bounds = self.mesh.shown().and_then(|mesh| mesh.bounds);
        let view = ViewUniform::new(frame, &sizes, bounds);
        let (mesh, behind) = (MeshVariant::new(frame), BehindVariant::new(frame));
        changed |= self.drawn != Some((view, mesh, behind));
        if changed {
            self.maker.queue.write_buffer(&self.view_buffer, 0, bytemuck::bytes_of(&view));
            self.draw_scene(encoder, mesh, behind, frame.look.resolution_scale < 1.0);
            self.drawn = Some((view, mesh, behind));
            self.status.scenes_drawn += 1;
        }
        let size = |slot: &Slot<_, GpuTexture>| slot.shown().map(|texture| texture.size);
        let (uniform, [photo, traced]) = ScreenUniform::new(frame, &sizes, size(&self.photo), size(&self.traced));
        let variant = ScreenVariant::new(frame, photo, traced);
        if changed || pictures_changed || self.pictured != Some((uniform, variant)) {
            self.maker.queue.write_buffer(&self.screen_buffer, 0, bytemuck::bytes_of(&uniform));
            self.make_picture(encoder, variant);
            self.pictured = Some((uniform, variant));
        }
        self.status.frames_shown += 1;
    }

    /// Shows the picture in the pass of the window.
    pub fn paint(&mut self, pass: &mut wgpu::RenderPass<'static>) {
        self.is_on_its_way = false;
        if let Some(targets) = self.targets.as_ref().filter(|_| self.is_shown) {
            self.copy.draw(pass, &targets.copied);
        }
    }

    fn sizes(&self, screen: [u32; 2], scale: f32, pixels_per_point: f32) -> Sizes {
        let scale = if scale.is_finite() { scale.clamp(0.25, 2.0) } else { 1.0 };
        let most = self.maker.device.limits().max_texture_dimension_2d;
        let target = screen.map(|side| ((side as f32 * scale).round() as u32).clamp(1, most));
        Sizes { screen, target, pixels_per_point }
    }

    /// Follows every handle of the content; whether the scene looks different, and whether what is laid over it does.
    fn follow_content(&mut self, frame: &StageFrame, context: &egui::Context) -> (bool, bool) {
        let content = &frame.content;
        let speed = |texels: usize| match (frame.wait_for_uploads || texels <= TEXELS_AT_ONCE, frame.quiet_uploads) {
            (true, _) => Speed::Now,
            (false, true) => Speed::Quietly,
            (false, false) => Speed::Later(context),
        };
        let pixels = |image: &RgbImage| image.pixels().len();

        let maker = self.maker.clone();
        let triangles = content.mesh.as_ref().map_or(0, |mesh| mesh.triangles.len());
        let key = content.mesh.clone().map(|mesh| (mesh, content.vertex_colours.clone()));
        let mut changed = self.mesh.follow(key, speed(triangles), move |(mesh, colours)| {
            GpuMesh::new(&maker, mesh, colours.as_deref().map(Vec::as_slice))
        });

        let maker = self.maker.clone();
        let texels = content.maps.as_ref().map_or(0, |maps| pixels(&maps.diffuse));
        let key = content.maps.clone().map(|maps| (maps, content.covered.clone()));
        changed |= self.maps.follow(key, speed(texels), move |(maps, covered)| {
            maker.materials(maps, covered.as_deref().map(|covered| &**covered))
        });

        let maker = self.maker.clone();
        // Uploaded only while it is looked at: nobody needs the four quantities of a fit at once.
        let quantity =
            content.quantity.as_ref().filter(|_| frame.look.layer.is_quantity()).map(|quantity| &quantity.texels);
        let texels = quantity.map_or(0, |texels| texels.pixels().len());
        changed |= self.quantity.follow(quantity.cloned(), speed(texels), move |texels| maker.quantity(texels));

        let maker = self.maker.clone();
        let photos = content.photos.as_ref().filter(|_| frame.crossfade().is_some());
        let key = photos.map(|(colours, seen)| (Arc::clone(colours), Some(Arc::clone(seen))));
        let texels = photos.map_or(0, |(colours, _)| pixels(&colours.diffuse));
        changed |= self.photos.follow(key, speed(texels), move |(colours, seen)| {
            maker.materials(colours, seen.as_deref().map(|seen| &**seen)).0
        });

        for (slot, light) in self.lights.iter_mut().zip([&content.light, &content.other_light]) {
            let maker = self.maker.clone();
            let key = light.as_ref().map(|light: &StageLight| (light.environment.clone(), content.lobe));
            // Blurring costs the same for a small one.
            changed |= slot.follow(key, speed(usize::MAX), move |(environment, lobe)| {
                GpuLight::new(&maker, &light::prepare(environment, *lobe))
            });
        }
        let mut pictures_changed = false;
        for (slot, picture, label) in [
            (&mut self.photo, &content.photo, "stage photo"),
            (&mut self.traced, &content.traced, "stage traced picture"),
        ] {
            let maker = self.maker.clone();
            let texels = picture.as_deref().map_or(0, pixels);
            pictures_changed |= slot.follow(picture.clone(), speed(texels), move |image| maker.picture(label, image));
        }
        let light_seconds: f64 = self.lights.iter().map(Slot::seconds).sum();
        self.status.upload_seconds = self.maps.seconds() + light_seconds;
        self.status.is_light_uploading = self.lights.iter().any(Slot::is_pending);
        self.status.is_uploading = self.mesh.is_pending()
            || self.maps.is_pending()
            || self.quantity.is_pending()
            || self.photos.is_pending()
            || self.status.is_light_uploading
            || self.photo.is_pending()
            || self.traced.is_pending();
        if changed {
            let of_mesh = self.mesh.shown().map(|mesh| &mesh.findings);
            let of_maps = self.maps.shown().map(|(_, _, findings)| findings);
            self.status.findings = of_mesh.into_iter().chain(of_maps).flatten().cloned().collect();
        }
        (changed, pictures_changed)
    }
}
