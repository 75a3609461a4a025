//! The user guide in a window of its own, beside the work it explains.

use crate::guide::Topic;
use crate::studio::model::Model;
use egui::{Context, ScrollArea, Window};
use egui_commonmark::{CommonMarkCache, CommonMarkViewer};

/// What the window keeps.
pub struct GuideMemory {
    topic: Topic,
    cache: CommonMarkCache,
}

impl Default for GuideMemory {
    fn default() -> Self {
        GuideMemory { topic: Topic::Window, cache: CommonMarkCache::default() }
    }
}

/// Draws the guide, if it is open.
pub fn show(context: &Context, model: &mut Model, memory: &mut GuideMemory) {
    if !model.guide {
        return;
    }
    let mut is_open = true;
    Window::new("User guide").open(&mut is_open).default_size([860.0, 620.0]).vscroll(false).show(context, |ui| {
        ui.horizontal_wrapped(|ui| {
            for topic in Topic::ALL {
                ui.selectable_value(&mut memory.topic, topic, topic.title());
            }
        });
        ui.separator();
        // Each topic is scrolled for itself.
        ScrollArea::vertical().id_salt(memory.topic.title()).auto_shrink(false).show(ui, |ui| {
            CommonMarkViewer::new().show(ui, &mut memory.cache, &without_blocks(memory.topic.text()));
        });
    });
    model.guide = is_open;
}

/// The text with each line of a code block as code of its own: blocks get a button whose sign the window's fonts lack.
fn without_blocks(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut is_code = false;
    for line in text.lines() {
        match (line.trim_start().starts_with("```"), is_code) {
            (true, _) => is_code = !is_code,
            (false, true) if !line.trim().is_empty() => plain += &format!("`{}`  ", line.trim_end()),
            (false, _) => plain += line,
        }
        plain.push('\n');
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_code_stand_for_themselves() {
        assert_eq!(without_blocks("a\n```sh\nb c\n\n```\nd"), "a\n\n`b c`  \n\n\nd\n");
        for topic in Topic::ALL {
            assert!(!without_blocks(topic.text()).contains("```"), "{}", topic.title());
        }
    }
}
