//! Where the eye stands, which light it sees by, and what is measured for it. What is saved of it is in `saving`.

use super::lights::LightName;
use super::tasks::TaskKind;
use super::{Cursor, Done, Model};
use crate::error::Place;
use crate::insight::surface_layers::{LayerSettings, SurfaceLayers, surface_layers};
use crate::job::entanglement::{EntanglementSettings, entanglement};
use crate::job::gallery::NamedLight;
use crate::job::pictures::parameters_with;
use crate::light::Environment;
use crate::material::MaterialMaps;
use crate::render::Parameters;
use crate::render::picture::PictureSettings;
use crate::scene::Camera;
use crate::studio::stage::eye::{Eye, OrbitEye};
use crate::studio::workspace::Panel;
use std::sync::Arc;

impl Model {
    /// Forgets the place under the cursor unless it is pinned.
    pub fn move_cursor(&mut self, cursor: Option<Cursor>) {
        let pinned = self.cursor.is_some_and(|own| own.pinned);
        if !pinned {
            self.cursor = cursor;
        }
    }

    /// Moves the eye so that what the photos show fills the viewport.
    pub fn frame_scene(&mut self) {
        if let Some(project) = &self.project {
            self.eye.fit(super::framing::subject(&project.mesh, project.scene.as_deref()), 1.4);
            self.switches.looking_through = false;
        }
    }

    /// Puts the eye where the chosen photo was taken, or leaves it there free to move.
    pub fn look_through(&mut self, on: bool) {
        if !on
            && self.switches.looking_through
            && let (Some(camera), Some(project)) = (self.chosen_camera(), &self.project)
        {
            self.eye = OrbitEye::from_camera(&camera, super::framing::bounds(&project.mesh));
        }
        self.switches.looking_through = on && self.chosen_camera().is_some();
        if !self.switches.looking_through {
            self.edits.photo = super::edits::PhotoLook::Off;
        }
    }

    /// The camera of the chosen photo.
    pub fn chosen_camera(&self) -> Option<Camera> {
        let project = self.project.as_ref()?;
        let scene = project.scene.as_ref()?;
        scene.views.get(project.chosen_view).map(|view| view.camera)
    }

    /// The eye that is in force.
    pub fn eye_in_force(&self) -> Eye {
        match self.chosen_camera() {
            Some(camera) if self.switches.looking_through => Eye::Photo(camera),
            _ => Eye::Orbit(self.eye),
        }
    }

    /// Shows the place of a finding.
    pub fn go_to(&mut self, place: Place) {
        match &place {
            Place::View(name) | Place::Pixel { view: name, .. } => {
                let name = name.clone();
                if self.project.as_mut().is_some_and(|project| project.choose_by_name(&name)) {
                    self.activate = Some(Panel::Photo);
                }
            }
            Place::Texel { map, .. } => {
                self.activate = Some(if map == "environment" { Panel::Light } else { Panel::Maps });
            }
            Place::Triangle(triangle) => {
                if let Some(project) = &self.project
                    && *triangle < project.mesh.triangles.len()
                {
                    let corners = project.mesh.corners(*triangle);
                    self.eye.target = (corners[0] + corners[1] + corners[2]) / 3.0;
                    self.switches.looking_through = false;
                    self.activate = Some(Panel::Stage);
                }
            }
            Place::Setting(_) => self.activate = Some(Panel::Fit),
            Place::Nowhere | Place::File(_) | Place::Line(..) | Place::Byte(..) => {}
        }
        self.go_to = Some(place);
    }

    /// Brings the bright end of the chosen photo into range.
    pub fn measure_exposure(&mut self) {
        if self.workspace == super::Workspace::Object {
            if let Some(photo) = self.object.photos.get(self.object.chosen_photo) {
                self.edits.display.exposure_stops = crate::image::histogram::auto_exposure(&photo.radiance);
            }
            return;
        }
        let Some(project) = &self.project else { return };
        if let Some(small) = project.thumbnails.get(project.chosen_view) {
            self.edits.display.exposure_stops = crate::image::histogram::auto_exposure(small.as_ref());
        }
    }

    /// Makes the sky of the hour anew where hour or latitude changed, by hand or by undo. Where the sun has not risen the sky
    /// before stands.
    pub fn follow_day(&mut self) {
        let day = self.edits.relight.day;
        if self.day_in_force != day {
            self.day_in_force = day;
            if let Some(light) = super::lights::of_day(&day) {
                self.shelf.put(light);
            }
        }
    }

    /// A light as it lights the stage: brought to the fitted one's brightness if so wished, made stronger; not turned.
    pub fn stage_light(&self, name: &LightName) -> Option<Arc<Environment>> {
        let relight = &self.edits.relight;
        let light = match relight.matched {
            true => self.shelf.matched(name)?.0,
            false => Arc::clone(&self.shelf.find(name)?.environment),
        };
        Some(light)
    }

    /// The same with turn and strength in its texels, for the path tracer.
    pub fn traced_light(&self, name: &LightName) -> Option<Environment> {
        let light = self.stage_light(name)?;
        Some(self.edits.relight.turned(&light))
    }

    /// How the path tracer draws the stage.
    pub fn picture_settings(&self, samples: usize) -> PictureSettings {
        let fit = &self.edits.fit;
        PictureSettings {
            samples,
            max_bounces: fit.bounces.max(2),
            background_visible: self.edits.relight.as_background,
            background_blur_degrees: self.edits.relight.background_blur_degrees(),
            lobe_strength: if fit.has_lobe() { 1.0 } else { 0.0 },
            two_sided: self
                .project
                .as_ref()
                .and_then(|project| project.scene.as_ref())
                .is_none_or(|scene| scene.truth.is_none()),
            ground: self.ground_height().filter(|_| self.edits.relight.ground),
            seed: 11,
            ..PictureSettings::default()
        }
    }

    /// Height of the lowest point of the surface.
    pub fn ground_height(&self) -> Option<f32> {
        let (low, _) = self.project.as_ref()?.mesh.bounds()?;
        Some(low.y)
    }

    /// Maps and light as the tracer reads them; `None` while there are no maps.
    pub fn traced_parameters(&self, light: &LightName) -> Option<Parameters<f32>> {
        let maps = self.project.as_ref()?.maps.as_ref()?;
        Some(parameters_with(maps, &self.traced_light(light)?, self.edits.fit.lobe))
    }

    /// Maps and light of the run as it was fitted, whatever lights the stage.
    pub fn run_parameters(&self) -> Option<Parameters<f32>> {
        let project = self.project.as_ref()?;
        Some(parameters_with(project.maps.as_ref()?, project.environment.as_ref()?, self.edits.fit.lobe))
    }

    /// Renders every photo again and spreads its error over the surface.
    pub fn measure_layers(&mut self) {
        let Some(project) = &self.project else { return };
        let (Some(scene), Some(surface), Some(maps), Some(environment)) =
            (project.scene.clone(), project.surface.clone(), project.maps.clone(), project.environment.clone())
        else {
            return;
        };
        if self.tasks.is_running(&TaskKind::Residuals) {
            return;
        }
        let excluded = scene.views.iter().map(|view| self.edits.fit.exclude.contains(&view.name)).collect();
        let settings = LayerSettings {
            picture: PictureSettings {
                background_visible: scene.background == crate::scene::Background::Environment,
                max_bounces: self.edits.fit.bounces,
                ground: None,
                ..self.picture_settings(8)
            },
            gains: self.gains(),
            excluded,
            ..LayerSettings::default()
        };
        let lobe = self.edits.fit.lobe;
        self.tasks.spawn(TaskKind::Residuals, move |context| {
            let own = parameters_with(&maps, &environment, lobe);
            let layers = surface_layers(&scene, &surface, &own, &settings, &context.stop, &|share| {
                context.tell("rendering", share);
            })?;
            Ok(Done::Layers(maps, Box::new(layers)))
        });
    }

    pub(super) fn layers_were_measured(&mut self, maps: &Arc<MaterialMaps>, layers: SurfaceLayers) {
        let Some(project) = &mut self.project else { return };
        if project.maps.as_ref().is_none_or(|own| !Arc::ptr_eq(own, maps)) {
            self.log.note("The maps changed while residuals were computed: compute them again");
            return;
        }
        project.photo_error_range = [0.0, high_end(&layers.photo_error)];
        project.disagreement_range = [0.0, high_end(&layers.disagreement)];
        project.photo_error = Some(Arc::new(layers.photo_error));
        project.disagreement = Some(Arc::new(layers.disagreement));
        // The counts that a run brings are of its photos at their full size: coarser ones do not replace them.
        if project.times_seen.as_ref().is_none_or(|own| own.width() <= layers.times_seen.width()) {
            project.times_seen = Some(Arc::new(layers.times_seen));
        }
        project.coverage = Some(Arc::new(layers.coverage));
        for (own, measured) in project.view_errors.iter_mut().zip(&layers.views) {
            *own = Some(measured.rmse as f32).filter(|rmse| rmse.is_finite());
        }
        self.log.note("Residuals are projected onto the surface");
    }

    /// Factor of each photo that a fit with exposure gains found; empty for ones.
    pub fn gains(&self) -> Vec<f32> {
        self.fit.gains(self.project.as_ref().and_then(|project| project.scene.as_deref()))
    }

    /// Compares pictures of the fit with those of the truth under lights it was not fitted to.
    pub fn measure_entanglement(&mut self) {
        let Some(project) = &self.project else { return };
        let (Some(scene), Some(surface)) = (project.scene.clone(), project.surface.clone()) else { return };
        let Some(own) = self.run_parameters() else { return };
        let skies = self.shelf.lights().iter().filter(|light| matches!(light.name, LightName::Sky(_)));
        let lights: Vec<NamedLight> = skies
            .filter_map(|light| {
                let (environment, _) = self.shelf.matched(&light.name)?;
                Some(NamedLight { name: light.name.label(), environment: (*environment).clone() })
            })
            .collect();
        let settings = EntanglementSettings {
            picture: PictureSettings { background_visible: false, ground: None, ..self.picture_settings(32) },
            ..EntanglementSettings::default()
        };
        self.tasks.spawn(TaskKind::NovelLighting, move |context| {
            let table = entanglement(&scene, &surface, &own, &lights, &settings, &context.stop, &|share| {
                context.tell("rendering", share);
            })?;
            Ok(Done::Entangled(Box::new(table)))
        });
    }
}

/// The value that all but the largest two in a hundred texels stay below; above zero.
fn high_end(texels: &crate::image::GreyImage) -> f32 {
    let values: Vec<f64> =
        texels.pixels().iter().filter(|value| value.is_finite()).map(|&value| f64::from(value)).collect();
    let high = crate::math::statistics::quantile(&values, 0.98) as f32;
    if high > 0.0 { high } else { 1.0 }
}
