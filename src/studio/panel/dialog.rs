//! Windows over the window: the palette of acts, help, a path, how to save. Those of export and import
//! have files of their own.

mod export;
mod import;

use super::act_line;
use crate::insight::report::number;
use crate::studio::act::{Act, ActInfo, Group, LIST};
use crate::studio::model::{Dialog, Model, PickFor, SaveRequest, SaveWhat};
use crate::studio::stage::Navigation;
use crate::studio::theme;
use egui::{Button, Context, DragValue, Grid, Id, Key, Modal, RichText, ScrollArea, TextEdit, Ui, Vec2, vec2};

/// Draws the dialog that is open, if any.
pub fn show(context: &Context, model: &mut Model) {
    let dialog = std::mem::take(&mut model.dialog);
    let id = match &dialog {
        Dialog::None => return,
        Dialog::Palette(_) => "palette",
        Dialog::Help => "help",
        Dialog::Path { .. } => "path",
        Dialog::Save(_) => "save",
        Dialog::Export(_) => "export",
        Dialog::Import(_) => "import",
    };
    let mut next = dialog.clone();
    // Where the window is too low for the whole of a dialog, the dialog scrolls.
    let scroll = ScrollArea::vertical().max_height(room(context).y);
    let modal = Modal::new(Id::unique(id)).show(context, |ui| {
        scroll.show(ui, |ui| match &mut next {
            Dialog::None => {}
            Dialog::Palette(query) => {
                if palette(ui, model, query) {
                    next = Dialog::None;
                }
            }
            Dialog::Help => {
                if help(ui, model) {
                    next = Dialog::None;
                }
            }
            Dialog::Path { purpose, text } => {
                let purpose = *purpose;
                if path(ui, model, purpose, text) {
                    next = Dialog::None;
                }
            }
            Dialog::Save(request) => {
                if save(ui, model, request) {
                    next = Dialog::None;
                }
            }
            Dialog::Import(request) => {
                if import::show(ui, model, request) {
                    next = Dialog::None;
                }
            }
            Dialog::Export(request) => {
                if export::show(ui, model, request) {
                    next = Dialog::None;
                }
            }
        })
    });
    if modal.should_close() {
        next = Dialog::None;
    }
    // What was done within may have opened another dialog: that one stands.
    if model.dialog == Dialog::None {
        model.dialog = next;
    }
}

/// Height of the list of commands, and of the help page, in points.
const LIST_HEIGHT: f32 = 360.0;
const HELP_HEIGHT: f32 = 480.0;

/// Width and height that a dialog may take of the window, in points.
fn room(context: &Context) -> Vec2 {
    (context.content_rect().size() - vec2(48.0, 64.0)).max(vec2(160.0, 120.0))
}

/// Makes a dialog so wide, or as wide as the window allows.
fn set_width(ui: &mut Ui, width: f32) {
    ui.set_width(width.min(room(ui.ctx()).x));
}

/// Acts whose name or help holds all words of a query: the one that is called so first, then those that begin with it.
fn found(query: &str) -> Vec<&'static ActInfo> {
    let words: Vec<String> = query.to_lowercase().split_whitespace().map(str::to_owned).collect();
    let holds = |text: &str| words.iter().all(|word| text.to_lowercase().contains(word));
    let mut hits: Vec<&ActInfo> =
        LIST.iter().filter(|info| info.act != Act::Palette && (holds(info.name) || holds(info.help))).collect();
    let query = query.trim().trim_end_matches('…').to_lowercase();
    hits.sort_by_key(|info| {
        let name = info.name.to_lowercase();
        (name.trim_end_matches('…') != query, !name.starts_with(&query), !holds(info.name))
    });
    hits
}

fn palette(ui: &mut Ui, model: &mut Model, query: &mut String) -> bool {
    set_width(ui, 480.0);
    let label = ui.label("Type a command");
    // The field has the keys before it is drawn for the first time: a person types on while the palette opens.
    let id = Id::unique("palette field");
    ui.memory_mut(|memory| memory.request_focus(id));
    let field =
        ui.add(TextEdit::singleline(query).id(id).desired_width(f32::INFINITY).hint_text("e.g. next environment"));
    let field = field.labelled_by(label.id);
    let hits = found(query);
    let enter = ui.input(|input| input.key_pressed(Key::Enter));
    let mut chosen = None;
    let place_id = Id::unique("palette place");
    let mut place = ui.data(|data| data.get_temp::<usize>(place_id)).unwrap_or(0);
    let (down, up) = ui.input(|input| (input.key_pressed(Key::ArrowDown), input.key_pressed(Key::ArrowUp)));
    place = (place + usize::from(down)).saturating_sub(usize::from(up)).min(hits.len().saturating_sub(1));
    // The list keeps its height while what is typed narrows it: nothing jumps under the mouse.
    let height = LIST_HEIGHT.min(room(ui.ctx()).y - 2.0 * ui.spacing().interact_size.y - 24.0).max(60.0);
    ScrollArea::vertical().max_height(height).min_scrolled_height(height).auto_shrink(false).show(ui, |ui| {
        ui.set_min_height(height);
        let width = ui.available_width();
        for (index, info) in hits.iter().enumerate() {
            let marked = index == place;
            let dress = |button: Button<'static>| button.selected(marked).min_size(vec2(width, 0.0));
            let response = act_line(ui, model, info, dress);
            if marked && (down || up) {
                response.scroll_to_me(None);
            }
            if response.clicked() || (enter && marked) {
                chosen = Some(info.act);
            }
        }
        if hits.is_empty() {
            ui.label(RichText::new("No matching command").weak());
        }
    });
    if field.changed() {
        place = 0;
    }
    ui.data_mut(|data| data.insert_temp(place_id, if chosen.is_some() { 0 } else { place }));
    if let Some(act) = chosen {
        model.act(act);
    }
    chosen.is_some()
}

fn help(ui: &mut Ui, model: &mut Model) -> bool {
    set_width(ui, 720.0);
    ui.heading("Keyboard shortcuts");
    ui.label(format!("{}, Shift-drag to rotate the environment.", model.preferences.navigation.words()));
    ui.horizontal(|ui| {
        ui.label("Navigate as in");
        for (own, name, words) in Navigation::NAMED {
            ui.selectable_value(&mut model.preferences.navigation, own, name).on_hover_text(words);
        }
    });
    ui.label("Click the surface to pin a texel: photo, viewport and maps show the same place.");
    ui.add_space(6.0);
    let height = HELP_HEIGHT.min(room(ui.ctx()).y - 150.0).max(60.0);
    ScrollArea::both().max_height(height).auto_shrink(false).show(ui, |ui| {
        for (group, title) in Group::ALL {
            super::heading(ui, title);
            Grid::new(title).num_columns(3).spacing([14.0, 3.0]).striped(true).show(ui, |ui| {
                for info in LIST.iter().filter(|info| info.group == group) {
                    let keys = info.shortcut.map(|shortcut| ui.ctx().format_shortcut(&shortcut)).unwrap_or_default();
                    ui.label(RichText::new(keys).monospace());
                    ui.label(info.name);
                    ui.label(RichText::new(info.help).weak());
                    ui.end_row();
                }
            });
        }
    });
    ui.add_space(6.0);
    let mut done = false;
    ui.horizontal(|ui| {
        if ui.button("User guide").clicked() {
            model.guide = true;
            done = true;
        }
        done |= ui.button("Close").clicked();
    });
    done
}

fn path(ui: &mut Ui, model: &mut Model, purpose: PickFor, text: &mut String) -> bool {
    set_width(ui, 520.0);
    let (title, hint) = match purpose {
        PickFor::Light => ("Import an HDRI", "/home/me/lights/garden.hdr"),
        PickFor::OtherRun => ("Compare with another run of this scene", "/home/me/runs/place-2"),
        PickFor::Queue => ("Add a scene to the queue", "/home/me/scenes/place"),
        PickFor::LightFolder => ("Import a folder of HDRIs", "/home/me/lights"),
        PickFor::ObjectPhoto => ("Add a photo of an object", "/home/me/photos/ball.exr"),
        PickFor::ObjectResult => ("Save result as", "/home/me/results/ball"),
        PickFor::Material => {
            ("Open a measured material, or the result of an estimation", "/home/me/brdfs/gold-paint.binary")
        }
        _ => ("Open a scene or a run", "/home/me/scenes/place"),
    };
    ui.heading(title);
    let label = ui.label("Path");
    let field = ui.add(TextEdit::singleline(text).desired_width(f32::INFINITY).hint_text(hint)).labelled_by(label.id);
    if text.is_empty() {
        field.request_focus();
    }
    let enter = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
    let mut done = false;
    ui.horizontal(|ui| {
        let typed = !text.trim().is_empty();
        let confirm = match purpose {
            PickFor::ObjectResult => "Save here",
            PickFor::Light | PickFor::LightFolder | PickFor::ObjectPhoto | PickFor::Queue => "Add this",
            _ => "Open this",
        };
        if ui.add_enabled(typed, Button::new(confirm)).clicked() || (enter && typed) {
            match purpose {
                PickFor::Light => model.add_light(text.trim().into()),
                PickFor::OtherRun
                | PickFor::Queue
                | PickFor::LightFolder
                | PickFor::ObjectPhoto
                | PickFor::ObjectResult
                | PickFor::Material => {
                    model.picked(purpose, text.trim().into());
                }
                _ => model.open(text.trim().into()),
            }
            done = true;
        }
        if ui.button("Browse…").on_hover_text("Open the system's file dialog").clicked() {
            model.pick(purpose);
            done = true;
        }
        done |= ui.button("Cancel").clicked();
    });
    if purpose != PickFor::ObjectResult {
        ui.label(RichText::new("You can also drop a folder or file on the window").weak());
    }
    done
}

fn save(ui: &mut Ui, model: &mut Model, request: &mut SaveRequest) -> bool {
    set_width(ui, 520.0);
    ui.heading(match request.what {
        SaveWhat::Picture => "Render image",
        SaveWhat::Turntable => "Render turntable",
        SaveWhat::Strip => "Export contact sheet",
        SaveWhat::FitFilm => "Save film of the fit",
    });
    Grid::new("save").num_columns(2).spacing([12.0, 6.0]).show(ui, |ui| {
        let label = ui.label(if request.what == SaveWhat::Picture { "Image file" } else { "Image folder" });
        ui.add(TextEdit::singleline(&mut request.path).desired_width(380.0f32.min(room(ui.ctx()).x - 120.0)))
            .labelled_by(label.id)
            .on_hover_text("PNG as shown in the viewport or EXR in linear radiance, by the file extension");
        ui.end_row();
        ui.label("Size (pixels)");
        ui.horizontal(|ui| {
            let side = |value| DragValue::new(value).range(16..=8192).speed(4.0);
            let label = ui.label("Width");
            ui.add(side(&mut request.width)).labelled_by(label.id);
            let label = ui.label("Height");
            ui.add(side(&mut request.height)).labelled_by(label.id);
        });
        ui.end_row();
        if request.what != SaveWhat::FitFilm {
            let label = ui.label("Samples per pixel");
            ui.add(DragValue::new(&mut request.samples).range(1..=4096))
                .labelled_by(label.id)
                .on_hover_text("Four times as many samples halve the noise and take four times as long");
            ui.end_row();
        }
        if matches!(request.what, SaveWhat::Turntable | SaveWhat::FitFilm) {
            let label = ui.label("Images");
            ui.add(DragValue::new(&mut request.frames).range(2..=720)).labelled_by(label.id);
            ui.end_row();
        }
    });
    match request.what {
        SaveWhat::Picture => {
            ui.checkbox(&mut request.cut_out, "Transparent background")
                .on_hover_text("Leave what the surface does not cover transparent; a ground plane keeps its shadow");
        }
        SaveWhat::Turntable => {
            ui.checkbox(&mut request.film, "Film of the images")
                .on_hover_text("MP4 where ffmpeg is installed, an animated PNG for browsers otherwise");
        }
        SaveWhat::Strip | SaveWhat::FitFilm => {}
    }
    let images = if request.what == SaveWhat::Turntable { request.frames as f64 } else { 1.0 };
    let paths = (request.width * request.height * request.samples) as f64 * images;
    let seconds = model.preferences.seconds_per_path.map(|own| own * paths);
    let told = seconds.map_or_else(
        || format!("{:.0} million samples", paths * 1e-6),
        |seconds| format!("About {} on this machine", number::duration(seconds)),
    );
    ui.label(
        RichText::new(match request.what {
            SaveWhat::FitFilm => {
                "Each state is shown for as long as it was the newest; MP4 where ffmpeg is installed".into()
            }
            _ => told,
        })
        .weak(),
    );
    let mut done = false;
    ui.horizontal(|ui| {
        let colours = theme::palette(ui.visuals());
        let button = Button::new(RichText::new("Save").color(colours.on_accent)).fill(colours.accent);
        if ui.add_enabled(!request.path.trim().is_empty(), button).clicked() {
            model.save(request.clone());
            done = true;
        }
        if request.what == SaveWhat::Picture && ui.button("Browse…").clicked() {
            model.dialog = Dialog::Save(request.clone());
            model.pick(PickFor::Save);
        }
        done |= ui.button("Cancel").clicked();
    });
    done
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_palette_finds_by_words_of_name_and_help() {
        assert_eq!(found("next env").first().map(|info| info.act), Some(Act::NextLight));
        assert_eq!(found("start fit").first().map(|info| info.act), Some(Act::Start));
        assert!(found("shadows interreflection").iter().any(|info| info.act == Act::Traced));
        // A whole name comes before a longer one that begins with it.
        assert_eq!(found("photo panel").first().map(|info| info.act), Some(Act::PanelPhoto));
        assert_eq!(found("photos panel").first().map(|info| info.act), Some(Act::PanelViews));
        assert!(found("xyzzy").is_empty());
        assert_eq!(found("").len(), LIST.len() - 1);
    }
}
