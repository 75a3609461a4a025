//! The panels of object mode, each in its file, in the order of the work: [`setup`] asks, [`picture`] shows photo and
//! re-render, [`reflectance`] and [`light`] what was found, [`relit`] the object elsewhere, [`objective`] how it went,
//! [`starts`] how sure it is. [`materials`], [`map`] and [`material`] are the library. [`lobes`] is what two of them share.

pub mod light;
pub mod lobes;
pub mod map;
pub mod material;
pub mod materials;
pub mod objective;
pub mod picture;
pub mod reflectance;
pub mod relit;
pub mod setup;
pub mod starts;
pub mod toolbar;

use crate::studio::model::Model;
use crate::studio::workspace::Panel;
use egui::Ui;

/// What the panels keep between frames.
#[derive(Default)]
pub struct ObjectMemory {
    setup: setup::SetupMemory,
    picture: picture::PictureMemory,
    reflectance: lobes::LobesMemory,
    material: lobes::LobesMemory,
    light: light::ObjectLightMemory,
    relit: relit::RelitMemory,
    objective: objective::ObjectiveMemory,
    materials: materials::MaterialsMemory,
}

/// Draws a panel of object mode.
pub fn show(panel: Panel, ui: &mut Ui, model: &mut Model, memory: &mut ObjectMemory) {
    match panel {
        Panel::Object => setup::show(ui, model, &mut memory.setup),
        Panel::ObjectPicture => picture::show(ui, model, &mut memory.picture),
        Panel::Reflectance => reflectance::show(ui, model, &mut memory.reflectance),
        Panel::ObjectLight => light::show(ui, model, &mut memory.light),
        Panel::Relit => relit::show(ui, model, &mut memory.relit),
        Panel::Objective => objective::show(ui, model, &mut memory.objective),
        Panel::Starts => starts::show(ui, model),
        Panel::Materials => materials::show(ui, model, &mut memory.materials),
        Panel::MaterialMap => map::show(ui, model, &mut memory.materials),
        Panel::Material => material::show(ui, model, &mut memory.material),
        _ => {}
    }
}
