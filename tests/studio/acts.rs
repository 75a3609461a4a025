//! Every act of the list, everywhere: in its menu, in the palette, by its key; it does something, or is grey and says why.

use super::support::{Key, Modifiers, TestStudio, finished_run};
use eframe::egui::{Event, ViewportCommand};
use egui_kittest::kittest::NodeT;
use patina::studio::act::availability::availability;
use patina::studio::act::{Act, ActInfo, Group, LIST};
use patina::studio::model::tasks::TaskKind;
use patina::studio::model::{Dialog, FitStatus, LightName};
use patina::studio::stage::{Layer, Navigation};
use patina::studio::workspace::{Panel, Workspace};

/// The title of an act's menu.
fn menu_of(info: &ActInfo) -> &'static str {
    Group::ALL.iter().find(|(group, _)| *group == info.group).unwrap().1
}

/// Opens a menu of the bar: the uppermost control of its title, since panels may be called alike.
fn open_menu(studio: &mut TestStudio, title: &str) {
    studio.click_first(title);
}

/// Opens the list within an open menu in which an act stands.
fn open_list(studio: &mut TestStudio, info: &ActInfo) {
    if let Some(list) = info.act.list().filter(|list| studio.controls(list).len() == 1) {
        studio.click(list);
    }
}

/// Brings about a state in which an act has something to do.
fn give_it_work(studio: &mut TestStudio, act: Act) {
    let model = studio.model();
    model.workspace = if act == Act::SceneWorkspace { Workspace::Object } else { Workspace::Scene };
    model.edits.layer = if act == Act::LayerNormal { Layer::Lit } else { Layer::Normal };
    model.edits.relight.first = LightName::Sky("noon".into());
    model.edits.relight.turn_degrees = 30.0;
    model.edits.display.exposure_stops = 1.25;
    model.eye.distance *= 1.5;
    model.preferences.navigation = if act == Act::NavigateMaya { Navigation::Patina } else { Navigation::Maya };
    let edits = model.edits.clone();
    model.history.restart(&edits);
    studio.harness.ctx.set_zoom_factor(1.1);
    // Another panel in front of each.
    for (panel, ..) in Panel::ALL {
        if Panel::of(act).is_none_or(|own| own != panel) {
            studio.harness.state_mut().layout.activate(panel);
        }
    }
    if matches!(act, Act::Undo | Act::Redo) {
        studio.model().edits.display.exposure_stops = 2.0;
        studio.frames(8);
    }
    if act == Act::Redo {
        studio.act(Act::Undo);
    }
    studio.frames(2);
}

/// Everything an act may change, as text; `commands` are those of the window's last frame.
fn everything(studio: &mut TestStudio) -> String {
    let harness = &studio.harness;
    let output = harness.output();
    let asked: Vec<String> = output.platform_output.commands.iter().map(|command| format!("{command:?}")).collect();
    let window = output.viewport_output.values().flat_map(|viewport| &viewport.commands);
    let closes = window.filter(|command| matches!(command, ViewportCommand::Close)).count();
    let (zoom, visible) = (harness.ctx.zoom_factor(), harness.state().layout.visible());
    let model = studio.model();
    let open = model.project.as_ref().map(|project| (project.title.clone(), project.chosen_view, project.is_run));
    let fit = (&model.fit.status, model.fit.last_checkpoint, model.fit.losses.len());
    let tasks: Vec<String> = model.tasks.progress().into_iter().map(|(kind, ..)| kind.words()).collect();
    format!(
        "{asked:?} {closes} {zoom} {visible:?} {open:?} {fit:?} {tasks:?} {:?} {:?} {:?} {:?} {:?} {:?}",
        model.workspace,
        model.edits,
        model.switches,
        (&model.dialog, model.guide),
        (model.preferences.theme, model.preferences.navigation),
        model.eye
    )
}

/// A key that goes down, within one frame.
fn pressed(modifiers: Modifiers, key: Key) -> Event {
    Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers }
}

/// How an act is asked for.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    Menu,
    Palette,
    Key,
}

/// Asks for an act that can be done; the frame in which it was done is the last.
fn ask_for(studio: &mut TestStudio, info: &ActInfo, way: Way) {
    match way {
        Way::Menu => {
            open_menu(studio, menu_of(info));
            open_list(studio, info);
            studio.line(info.name).click();
        }
        Way::Palette => {
            studio.press(Modifiers::COMMAND, Key::K);
            studio.type_text(info.name);
            // The press alone: nothing is drawn between it and what it does.
            studio.harness.event(pressed(Modifiers::NONE, Key::Enter));
        }
        Way::Key => {
            let shortcut = info.shortcut.unwrap();
            studio.harness.event(pressed(shortcut.modifiers, shortcut.logical_key));
        }
    }
    studio.harness.step();
}

/// Does every act of a studio with a finished run, one way, and holds that each did something.
fn every_act_does_something(way: Way) {
    let mut studio = TestStudio::with_finished_run();
    for info in LIST {
        let is_by_key = way == Way::Key;
        if is_by_key && info.shortcut.is_none() || way == Way::Palette && info.act == Act::Palette {
            continue;
        }
        give_it_work(&mut studio, info.act);
        if let Err(why) = availability(info.act, studio.model()) {
            // These need a fit that is in progress: see below.
            assert!(NEED_A_FIT.contains(&info.act), "{}: {why}", info.name);
            continue;
        }
        let before = everything(&mut studio);
        ask_for(&mut studio, info, way);
        let mut changed = everything(&mut studio) != before;
        if !changed {
            // What the model brings to the front comes a frame later.
            studio.frames(1);
            changed = everything(&mut studio) != before;
        }
        assert!(changed, "{} did nothing: {before}", info.name);
        let stays_open = matches!(studio.model().dialog, Dialog::Palette(_)) && info.act != Act::Palette;
        assert!(!stays_open, "{} was not found first", info.name);
        let was_left = studio.model().project.is_none();
        let model = studio.model();
        model.tasks.stop_all();
        model.dialog = Dialog::None;
        model.guide = false;
        model.switches.alone = false;
        model.switches.looking_through = false;
        studio.press(Modifiers::NONE, Key::Escape);
        if was_left || info.act == Act::Start {
            // What is open would stay until the run is read.
            studio.model().close();
            studio.model().open(finished_run().into());
            studio.wait("the run", |model| model.project.is_some());
        }
    }
}

/// Acts that are grey while no fit is in progress.
const NEED_A_FIT: [Act; 12] = [
    Act::PauseOrGoOn,
    Act::Stop,
    Act::StepOnce,
    Act::Checkpoint,
    Act::SaveFitFilm,
    // And those that need a photo of an object, a result, or the library.
    Act::ObjectStart,
    Act::ObjectStop,
    Act::ObjectRelight,
    Act::ObjectSave,
    Act::ObjectReport,
    Act::NextMaterial,
    Act::PreviousMaterial,
];

#[test]
fn every_act_does_something_from_its_menu() {
    every_act_does_something(Way::Menu);
}

#[test]
#[ignore = "slow: every act; by the menu it is among the quick ones"]
fn every_act_does_something_from_the_palette() {
    every_act_does_something(Way::Palette);
}

#[test]
#[ignore = "slow: every act; by the menu it is among the quick ones"]
fn every_act_does_something_by_its_key() {
    every_act_does_something(Way::Key);
}

#[test]
fn acts_on_a_fit_in_progress_do_something_from_menu_and_palette() {
    let mut studio = TestStudio::with_running_fit();
    for way in [Way::Menu, Way::Palette] {
        ask_for(&mut studio, Act::PauseOrGoOn.info(), way);
        studio.wait("the pause", |model| model.fit.status == FitStatus::Paused);
        let held_at = studio.steps_done();
        ask_for(&mut studio, Act::StepOnce.info(), way);
        studio.wait_for_step(held_at + 1);
        studio.frames(2);
        let written = studio.model().fit.last_checkpoint;
        ask_for(&mut studio, Act::Checkpoint.info(), way);
        studio.wait("the checkpoint", move |model| model.fit.last_checkpoint != written);
        studio.wait("two states", |model| model.timeline.states().len() >= 2);
        ask_for(&mut studio, Act::SaveFitFilm.info(), way);
        assert!(matches!(studio.model().dialog, Dialog::Save(_)));
        studio.model().dialog = Dialog::None;
        ask_for(&mut studio, Act::PauseOrGoOn.info(), way);
        studio.wait("going on", |model| model.fit.status == FitStatus::Running);
        ask_for(&mut studio, Act::Stop.info(), way);
        studio.wait("the end", |model| model.fit.status == FitStatus::Stopped);
        ask_for(&mut studio, Act::Start.info(), way);
        studio.wait("going on", |model| model.fit.status == FitStatus::Running);
    }
}

/// Holds that in every menu, and in the palette, just those acts are grey that cannot be done, and that each grey one
/// says why under the mouse. Returns how many are grey.
fn grey_ones_say_why(studio: &mut TestStudio) -> usize {
    let mut grey = 0;
    for (group, title) in Group::ALL {
        open_menu(studio, title);
        // Those of a list within the menu come last, list by list.
        let mut of_group: Vec<&ActInfo> = LIST.iter().filter(|info| info.group == group).collect();
        of_group.sort_by_key(|info| info.act.list());
        for info in of_group {
            if info.act.list().is_some() && !studio.has_line(info.name) {
                open_list(studio, info);
            }
            let refused = availability(info.act, studio.model()).err();
            assert_eq!(
                studio.line(info.name).accesskit_node().is_disabled(),
                refused.is_some(),
                "{title}, {}: {refused:?}",
                info.name
            );
            let Some(why) = refused else { continue };
            grey += 1;
            studio.line(info.name).hover();
            let words = format!("{}\nNot now: {why}", info.help);
            let told = (0..12).any(|_| {
                studio.frames(1);
                studio.says(&words)
            });
            assert!(told, "{title}, {} does not say {words:?}", info.name);
        }
        studio.press(Modifiers::NONE, Key::Escape);
    }
    studio.press(Modifiers::COMMAND, Key::K);
    for info in LIST.iter().filter(|info| info.act != Act::Palette) {
        let refused = availability(info.act, studio.model()).err();
        assert_eq!(
            studio.line(info.name).accesskit_node().is_disabled(),
            refused.is_some(),
            "{}: {refused:?}",
            info.name
        );
    }
    studio.press(Modifiers::NONE, Key::Escape);
    grey
}

#[test]
fn acts_that_cannot_be_done_are_grey_and_say_why() {
    let mut first_page = TestStudio::new();
    first_page.frames(2);
    let at_first = grey_ones_say_why(&mut first_page);
    let with_run = grey_ones_say_why(&mut TestStudio::with_finished_run());
    assert!(at_first > 40 && with_run < 19, "{at_first} on the first page, {with_run} on a run");
    let mut running = TestStudio::with_running_fit();
    running.click("Pause fit");
    running.wait("the pause", |model| model.fit.status == FitStatus::Paused);
    grey_ones_say_why(&mut running);
}

#[test]
fn every_panel_comes_by_its_tab_and_shows_what_is_its_own() {
    let mut studio = TestStudio::with_finished_run();
    let own_words = |panel| match panel {
        Panel::Fit => "All settings",
        Panel::Views => "Exclude",
        Panel::Stage => "No 3-D rendering available",
        Panel::Photo => "Excluded pixels",
        Panel::Maps => "UV seams",
        Panel::Light => "Mirror ball",
        Panel::Relight => "Normalize intensity",
        Panel::Record => "No texel",
        Panel::Curves => "Details",
        Panel::Messages => "No issues",
        Panel::Scores => "Compare under novel lighting",
        other => panic!("{other:?} is not of scene mode"),
    };
    studio.model().log.clear();
    for (panel, title, _) in Panel::ALL {
        studio.act(Act::ResetLayout);
        // Something else in front of it first.
        let sibling = match panel {
            Panel::Fit => Some(Panel::Views),
            Panel::Stage => Some(Panel::Photo),
            Panel::Curves => Some(Panel::Scores),
            Panel::Maps => Some(Panel::Light),
            Panel::Relight => Some(Panel::Record),
            _ => None,
        };
        if let Some(sibling) = sibling {
            studio.show(sibling);
        }
        assert!(!studio.harness.state().layout.visible().contains(&panel), "{title} hides at first");
        let shows = |studio: &TestStudio, words: &str| studio.says(words) || !studio.controls(words).is_empty();
        let words = own_words(panel);
        assert!(!shows(&studio, words), "{words:?} shows without {title}");
        studio.click_tab(title);
        assert!(studio.harness.state().layout.visible().contains(&panel), "{title} did not come");
        assert!(shows(&studio, words), "{title} does not show {words:?}");
    }
}

/// Acts that leave the window, or what is open.
const LEAVING: [Act; 4] = [Act::Quit, Act::OpenDemo, Act::CloseProject, Act::ObjectWorkspace];

/// Does every act once and holds that one that cannot be done says why.
fn do_every_act(studio: &mut TestStudio) {
    for info in LIST.iter().filter(|info| !LEAVING.contains(&info.act)) {
        studio.model().log.clear();
        let refused = availability(info.act, studio.model()).err();
        studio.act(info.act);
        // A fit that was about to start may have begun meanwhile.
        let still = availability(info.act, studio.model()).err();
        if let Some(why) = refused.filter(|why| still == Some(*why)) {
            let words = format!("{}: {why}", info.act.bare_name());
            assert!(studio.log().contains(&words), "{words} is not in {}", studio.log());
        }
        studio.model().dialog = Dialog::None;
        studio.frames(1);
    }
}

/// Ends all that was begun, and waits for it.
fn come_to_rest(studio: &mut TestStudio) {
    studio.wait("the end of the start", |model| {
        !model.start_is_queued && !model.is_preparing() && !model.tasks.is_running(&TaskKind::Starting)
    });
    studio.model().tasks.stop_all();
    studio.model().fit.stop();
    studio.wait("the end", |model| !model.fit.status.is_live());
}

#[test]
fn every_act_can_be_asked_for_on_the_first_page() {
    let mut studio = TestStudio::new();
    do_every_act(&mut studio);
    studio.act(Act::SceneWorkspace);
    studio.act(Act::CloseProject);
    assert!(studio.log().contains("open a scene first"), "{}", studio.log());
    studio.control("Open the built-in demo");
}

#[test]
fn every_act_can_be_asked_for_on_a_scene_and_while_a_fit_starts_and_stops() {
    let mut studio = TestStudio::with_small_scene();
    do_every_act(&mut studio);
    come_to_rest(&mut studio);
    studio.act(Act::CloseProject);
    assert!(studio.model().project.is_none());
}

#[test]
#[ignore = "slow: every act; on the first page and on a scene it is among the quick ones"]
fn every_act_can_be_asked_for_on_a_run_and_while_a_fit_runs() {
    let mut studio = TestStudio::with_finished_run();
    do_every_act(&mut studio);
    come_to_rest(&mut studio);
    studio.act(Act::CloseProject);
    let mut studio = TestStudio::with_running_fit();
    do_every_act(&mut studio);
    studio.act(Act::CloseProject);
    assert_eq!((studio.model().project.is_none(), &studio.model().fit.status), (true, &FitStatus::Idle));
    studio.control("Open the built-in demo");
}
