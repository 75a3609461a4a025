//! From keys to acts.

use super::{Act, LIST};
use egui::{Context, Key, KeyboardShortcut};

/// The acts whose keys were pressed since the last frame, in the order of the list. Keys belong to a text field while
/// one is being typed in, except those with the command key that mean nothing in a text.
pub fn pressed(context: &Context) -> Vec<Act> {
    let typing = context.text_edit_focused();
    // A control that was reached by Tab takes the keys that work on controls.
    let on_control = context.memory(|memory| memory.focused().is_some());
    let mut shortcuts: Vec<(KeyboardShortcut, Act)> =
        LIST.iter().filter_map(|info| info.shortcut.map(|shortcut| (shortcut, info.act))).collect();
    // A shortcut with more modifiers is tried first: Shift is otherwise ignored where it is not asked for.
    shortcuts.sort_by_key(|(shortcut, act)| (std::cmp::Reverse(modifier_count(shortcut)), *act));
    let mut acts = Vec::new();
    context.input_mut(|input| {
        for (shortcut, act) in shortcuts {
            let is_of_text = matches!(act, Act::Undo | Act::Redo | Act::NextMaterial | Act::PreviousMaterial);
            let belongs_to_text = typing && (!shortcut.modifiers.command || is_of_text);
            let works_control = shortcut.modifiers.is_none() && CONTROL_KEYS.contains(&shortcut.logical_key);
            let is_free = !(belongs_to_text || on_control && works_control);
            if is_free && input.consume_shortcut(&shortcut) {
                acts.push(act);
            }
        }
        // The second keys that fingers know from other tools.
        if !typing {
            for (second, act) in SECOND_KEYS {
                if input.consume_shortcut(second) {
                    acts.push(*act);
                }
            }
        }
    });
    acts
}

/// Keys that press or move a control that has the focus.
const CONTROL_KEYS: [Key; 4] = [Key::Space, Key::ArrowLeft, Key::ArrowRight, Key::Home];

const SECOND_KEYS: &[(KeyboardShortcut, Act)] = &[
    (KeyboardShortcut::new(egui::Modifiers::COMMAND.plus(egui::Modifiers::SHIFT), egui::Key::P), Act::Palette),
    (KeyboardShortcut::new(egui::Modifiers::COMMAND, egui::Key::Y), Act::Redo),
    (KeyboardShortcut::new(egui::Modifiers::NONE, egui::Key::Questionmark), Act::Help),
    (KeyboardShortcut::new(egui::Modifiers::COMMAND, egui::Key::Equals), Act::ZoomIn),
];

fn modifier_count(shortcut: &KeyboardShortcut) -> usize {
    let modifiers = shortcut.modifiers;
    [modifiers.alt, modifiers.shift, modifiers.command || modifiers.ctrl].iter().filter(|&&held| held).count()
}
