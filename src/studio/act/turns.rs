//! Keys in turn: a slow frame may bring several, and what one does decides what the next ones mean.
//!
//! Ctrl+K and letters in one frame would open the palette and then press shortcuts; Enter and Ctrl+K would close it and lose
//! the rest. So a frame takes events up to the first key that may open or close something, and the next frame goes on.

use egui::{Event, Key};

/// Takes out of a frame's events those that come after the first key that may change what keys mean, in their order.
pub fn held_back(events: &mut Vec<Event>) -> Vec<Event> {
    let first = events.iter().position(changes_meaning);
    match first {
        // Letting a key go is part of pressing it.
        Some(place) => events.split_off(place + 1),
        None => Vec::new(),
    }
}

fn changes_meaning(event: &Event) -> bool {
    let Event::Key { key, pressed: true, modifiers, .. } = event else { return false };
    modifiers.command || matches!(key, Key::Enter | Key::Escape | Key::Tab | Key::F1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::Modifiers;

    fn key(key: Key, modifiers: Modifiers) -> Event {
        Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers }
    }

    #[test]
    fn letters_after_the_key_of_the_palette_come_in_the_next_frame() {
        let letters = [Event::Text("n".into()), Event::Text("e".into())];
        let mut events = vec![key(Key::Enter, Modifiers::NONE), key(Key::K, Modifiers::COMMAND)];
        events.extend(letters.clone());
        let mut rest = held_back(&mut events);
        assert_eq!(events, [key(Key::Enter, Modifiers::NONE)]);
        let last = held_back(&mut rest);
        assert_eq!(rest, [key(Key::K, Modifiers::COMMAND)]);
        assert_eq!(last, letters);
    }

    #[test]
    fn what_is_typed_and_moved_is_taken_at_once() {
        let mut events = vec![key(Key::A, Modifiers::NONE), Event::Text("a".into()), Event::PointerGone];
        let all = events.clone();
        assert_eq!(held_back(&mut events), []);
        assert_eq!(events, all);
    }
}
