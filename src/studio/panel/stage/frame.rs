//! From the model to a frame of the stage. What is costly to make is made once and kept.

use crate::image::{GreyImage, RgbImage};
use crate::job::prepare::covered;
use crate::render::Surface;
use crate::scene::Scene;
use crate::studio::model::edits::PhotoLook;
use crate::studio::model::known::Told;
use crate::studio::model::lights::LightName;
use crate::studio::model::{Model, Project};
use crate::studio::stage::eye::Eye;
use crate::studio::stage::{
    Backdrop, CoveredTexels, Layer, PhotoMode, StageCamera, StageContent, StageFrame, StageLight, StageLook,
    StageQuantity, frustum_depth,
};
use crate::studio::theme;
use egui::Visuals;
use std::sync::Arc;

/// What was made for former frames.
#[derive(Default)]
pub struct FrameCache {
    photo: Option<(Arc<Scene>, usize, Arc<RgbImage>)>,
    covered: Option<(Arc<Surface>, usize, Arc<CoveredTexels>)>,
    lights: Vec<(LightName, bool, Arc<crate::light::Environment>, Arc<crate::light::Environment>)>,
    cameras: Option<(CameraKey, Arc<Vec<StageCamera>>)>,
}

/// What the cameras on the stage depend on.
#[derive(Clone, PartialEq)]
struct CameraKey {
    scene: usize,
    errors: Vec<Option<f32>>,
    excluded: Vec<String>,
    chosen: usize,
    thumbnails: bool,
}

impl FrameCache {
    /// The frame of the model as it is, seen by an eye.
    pub fn frame(&mut self, model: &Model, eye: Eye, visuals: &Visuals) -> StageFrame {
        let colours = theme::palette(visuals);
        let Some(project) = &model.project else { return StageFrame::default() };
        let relight = &model.edits.relight;
        let turn = relight.turn_degrees.to_radians();
        let strength = relight.strength_stops.exp2();
        let mut light = |name: &LightName| {
            let environment = self.light(model, name)?;
            Some(StageLight { environment, rotation_radians: turn, strength })
        };
        let first = light(&relight.first);
        let second = relight.second.as_ref().and_then(&mut light);
        let through = matches!(eye, Eye::Photo(_));
        let shift = model.switches.looking_through && model.peek_photo;
        let photo_mode = match model.edits.photo {
            _ if !through => PhotoMode::Off,
            _ if shift => PhotoMode::Over(1.0),
            PhotoLook::Off => PhotoMode::Off,
            PhotoLook::Under => PhotoMode::Under,
            PhotoLook::Over(opacity) => PhotoMode::Over(opacity),
            PhotoLook::Wipe(share) => PhotoMode::Wipe(share),
        };
        let cameras = if model.switches.frustums && !through { self.cameras(model, project) } else { Arc::default() };
        let layer = model.shown_layer();
        let lit = model.shows_light();
        let laid = project.laid.as_ref().filter(|_| layer == Layer::Photos);
        let on_texels = laid.and_then(|laid| laid.texels.clone());
        let on_vertices = laid.filter(|_| on_texels.is_none());
        let backdrop = match lit && relight.as_background {
            true if relight.is_background_blurred => Backdrop::BlurredLight,
            true => Backdrop::Light,
            false => Backdrop::Colour(colours.stage),
        };
        StageFrame {
            eye,
            content: StageContent {
                // Until the atlas has colours of its own, those of the mesh before it stand.
                mesh: Some(Arc::clone(on_vertices.map_or(&project.mesh, |laid| &laid.mesh))),
                maps: on_texels.as_ref().map(|(maps, _)| Arc::clone(maps)).or_else(|| project.maps.clone()),
                covered: match &on_texels {
                    Some((_, seen)) => Some(Arc::clone(seen)),
                    None => self.covered(project),
                },
                vertex_colours: on_vertices.and_then(|laid| laid.vertices.clone()),
                photos: (layer == Layer::Crossfade).then(|| project.laid.as_ref()?.texels.clone()).flatten(),
                lobe_strength: if model.edits.fit.has_lobe() { 1.0 } else { 0.0 },
                lobe: model.edits.fit.lobe,
                light: first,
                other_light: second,
                quantity: quantity(project, layer),
                photo: (photo_mode != PhotoMode::Off).then(|| self.photo(project)).flatten(),
                traced: None,
                frustum_depth: frustum_depth(&cameras, project.mesh.bounds()),
                cameras,
            },
            look: StageLook {
                layer,
                display: model.edits.display,
                photo_mode,
                crossfade: model.edits.crossfade,
                light_wipe: (lit && relight.second.is_some()).then_some(relight.wipe),
                backdrop,
                accent: colours.accent,
                ..StageLook::default()
            },
            wait_for_uploads: false,
            quiet_uploads: model.nobody_waits,
        }
    }

    /// The photo of the chosen view, linear.
    fn photo(&mut self, project: &Project) -> Option<Arc<RgbImage>> {
        let scene = project.scene.as_ref()?;
        let known =
            self.photo.as_ref().filter(|(own, view, _)| Arc::ptr_eq(own, scene) && *view == project.chosen_view);
        if let Some((.., photo)) = known {
            return Some(Arc::clone(photo));
        }
        let photo = Arc::new(scene.views.get(project.chosen_view)?.photo.to_linear());
        self.photo = Some((Arc::clone(scene), project.chosen_view, Arc::clone(&photo)));
        Some(photo)
    }

    /// Texels of a chart at the size of the maps.
    fn covered(&mut self, project: &Project) -> Option<Arc<CoveredTexels>> {
        let (surface, maps) = (project.surface.as_ref()?, project.maps.as_ref()?);
        let size = maps.diffuse.width();
        let known = self.covered.as_ref().filter(|(own, width, _)| Arc::ptr_eq(own, surface) && *width == size);
        if let Some((.., texels)) = known {
            return Some(Arc::clone(texels));
        }
        let own = Arc::clone(surface);
        let texels: Arc<CoveredTexels> = Arc::new(CoveredTexels::new(Box::new(move || covered(&own, size))));
        self.covered = Some((Arc::clone(surface), size, Arc::clone(&texels)));
        Some(texels)
    }

    /// A light as it lights the stage; the same pointer as long as it is the same light.
    fn light(&mut self, model: &Model, name: &LightName) -> Option<Arc<crate::light::Environment>> {
        let matched = model.edits.relight.matched;
        let source = Arc::clone(&model.shelf.find(name)?.environment);
        // A light brought to the fitted one's brightness follows the fit by a twentieth of a stop or more.
        let made = model.stage_light(name)?;
        let place = self.lights.iter().position(|(own, was_matched, from, _)| {
            own == name && *was_matched == matched && Arc::ptr_eq(from, &source)
        });
        let brightness = |light: &crate::light::Environment| crate::math::luminance(light.mean_radiance()).max(1e-9);
        if let Some(place) = place {
            let known = &self.lights[place].3;
            if (brightness(known) / brightness(&made)).log2().abs() < 0.05 {
                return Some(Arc::clone(known));
            }
            self.lights.remove(place);
        }
        self.lights.retain(|(own, ..)| own != name);
        self.lights.push((name.clone(), matched, source, Arc::clone(&made)));
        Some(made)
    }

    fn cameras(&mut self, model: &Model, project: &Project) -> Arc<Vec<StageCamera>> {
        let Some(scene) = &project.scene else { return Arc::default() };
        let key = CameraKey {
            scene: Arc::as_ptr(scene) as usize,
            errors: project.view_errors.clone(),
            excluded: model.edits.fit.exclude.clone(),
            chosen: project.chosen_view,
            thumbnails: model.switches.thumbnails,
        };
        if let Some((_, cameras)) = self.cameras.as_ref().filter(|(own, _)| *own == key) {
            return Arc::clone(cameras);
        }
        let worst = key.errors.iter().flatten().fold(0.0f32, |worst, &error| worst.max(error));
        let camera = |(index, view): (usize, &crate::scene::View)| StageCamera {
            error_0_1: key.errors.get(index).copied().flatten().map(|error| error / worst.max(1e-9)),
            held_out: view.held_out,
            excluded: key.excluded.contains(&view.name),
            selected: index == project.chosen_view,
            thumbnail: project.thumbnails.get(index).filter(|_| key.thumbnails).cloned(),
            ..StageCamera::new(view.camera)
        };
        let cameras = Arc::new(scene.views.iter().enumerate().map(camera).collect());
        self.cameras = Some((key, Arc::clone(&cameras)));
        cameras
    }
}

/// The numbers a layer of a quantity shows.
fn quantity(project: &Project, layer: Layer) -> Option<StageQuantity> {
    let of =
        |texels: &Option<Arc<GreyImage>>, range: [f32; 2]| texels.clone().map(|texels| StageQuantity { texels, range });
    match layer {
        Layer::PhotoError => of(&project.photo_error, project.photo_error_range),
        Layer::Coverage => of(&project.coverage, [0.0, 1.0]),
        Layer::TimesSeen => of(&project.times_seen, [0.0, project.view_count().max(1) as f32]),
        Layer::Disagreement => of(&project.disagreement, project.disagreement_range),
        _ => {
            let layer = project.known.layer(told_by(layer)?)?;
            let [low, high] = layer.range;
            let range = if layer.is_by_factors() { [low.log2(), high.log2()] } else { layer.range };
            Some(StageQuantity { texels: Arc::clone(&layer.even), range })
        }
    }
}

/// What a layer of the solver shows; `None` for the others.
pub(super) fn told_by(layer: Layer) -> Option<Told> {
    match layer {
        Layer::DiffuseDeviation => Some(Told::Diffuse),
        Layer::SpecularDeviation => Some(Told::Specular),
        Layer::RoughnessDeviation => Some(Told::Roughness),
        Layer::LobeSharing => Some(Told::LobeSharing),
        Layer::Choice => Some(Told::Choice),
        _ => None,
    }
}
