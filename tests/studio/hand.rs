//! What a hand and an eye do with a studio: find controls by their labels, click, type, read.

use super::support::TestStudio;
use eframe::egui::accesskit::Role;
use eframe::egui::{Event, Key, Modifiers, PointerButton, Pos2};
use egui_kittest::Node;
use egui_kittest::kittest::{By, NodeT, Queryable};

impl TestStudio {
    /// The one control with this label: not a text, not a title.
    #[track_caller]
    pub fn control(&self, label: &str) -> Node<'_> {
        let all = self.controls(label);
        assert_eq!(all.len(), 1, "{} controls are called {label:?}: {all:#?}; {}", all.len(), self.log());
        all[0]
    }

    /// All controls with this label.
    pub fn controls(&self, label: &str) -> Vec<Node<'_>> {
        let is_control =
            |node: &Node<'_>| !matches!(node.accesskit_node().role(), Role::Label | Role::GenericContainer);
        // The label's lifetime is that of the query, not of the tree.
        let wanted = label.to_owned();
        let by = By::new().predicate(move |node| node.label().is_some_and(|own| own == wanted));
        self.harness.query_all(by).filter(is_control).collect()
    }

    /// The one line of the open menu or palette with this label; buttons of the panels may be called alike.
    #[track_caller]
    pub fn line(&self, label: &str) -> Node<'_> {
        self.control_of(Role::MenuItem, label)
    }

    /// Whether the open menu or palette has a line with this label.
    pub fn has_line(&self, label: &str) -> bool {
        self.controls(label).iter().any(|node| node.accesskit_node().role() == Role::MenuItem)
    }

    /// Whether any widget, text included, says this somewhere.
    pub fn says(&self, text: &str) -> bool {
        let wanted = text.to_owned();
        let by = By::new().predicate(move |node| {
            let is_text = node.role() == Role::Label;
            let own = if is_text { node.value() } else { node.label() };
            own.is_some_and(|own| own.contains(&wanted))
        });
        self.harness.query_all(by).next().is_some()
    }

    /// Clicks the one control with this label.
    #[track_caller]
    pub fn click(&mut self, label: &str) {
        self.click_found(|studio| studio.control(label));
    }

    /// Clicks the one control of this kind with this label.
    #[track_caller]
    pub fn click_role(&mut self, role: Role, label: &str) {
        self.click_found(|studio| studio.control_of(role, label));
    }

    /// Scrolls, as a person does, until a control is seen, and clicks it: a click goes where the mouse is, and below the
    /// end of a panel there is another panel.
    #[track_caller]
    fn click_found(&mut self, find: impl for<'a> Fn(&'a TestStudio) -> Node<'a>) {
        find(self).scroll_to_me();
        let mut before = find(self).rect();
        for _ in 0..30 {
            // The wish is heard in one frame, the panel begins to move in the next, and shows it in a third.
            self.frames(4);
            let now = find(self).rect();
            if now == before {
                break;
            }
            before = now;
        }
        let node = find(self);
        assert!(!node.accesskit_node().is_disabled(), "{node:?} is grey; {}", self.log());
        node.click();
        // A window over the window is measured in one frame and seen in the next.
        self.frames(3);
    }

    /// Presses and releases the mouse at a place.
    pub fn click_at(&mut self, at: Pos2) {
        self.harness.hover_at(at);
        self.frames(2);
        for pressed in [true, false] {
            let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
            self.harness.event(Event::PointerButton { pos: at, button, pressed, modifiers });
        }
        self.frames(3);
    }

    /// Clicks the tab of a panel; menus are called alike, but are not switched on and off.
    #[track_caller]
    pub fn click_tab(&mut self, title: &str) {
        let is_tab = |node: &Node<'_>| {
            let node = node.accesskit_node();
            node.role() == Role::Button && node.toggled().is_some()
        };
        let tabs: Vec<_> = self.controls(title).into_iter().filter(is_tab).collect();
        assert_eq!(tabs.len(), 1, "tabs called {title}: {tabs:#?}");
        tabs[0].click();
        self.frames(3);
    }

    /// The one control of this kind with this label.
    #[track_caller]
    pub fn control_of(&self, role: Role, label: &str) -> Node<'_> {
        let nodes: Vec<_> =
            self.controls(label).into_iter().filter(|node| node.accesskit_node().role() == role).collect();
        assert_eq!(nodes.len(), 1, "{nodes:#?}");
        nodes[0]
    }

    /// Clicks the uppermost control with this label, where a menu and a tab are called alike.
    #[track_caller]
    pub fn click_first(&mut self, label: &str) {
        let nodes = self.controls(label);
        assert!(!nodes.is_empty(), "no control is called {label:?}; {}", self.log());
        let top = nodes.iter().min_by(|a, b| a.rect().top().total_cmp(&b.rect().top())).copied().unwrap();
        top.click();
        self.frames(2);
    }

    /// Whether the one control with this label is grey.
    #[track_caller]
    pub fn is_grey(&self, label: &str) -> bool {
        self.control(label).accesskit_node().is_disabled()
    }

    /// The number in a field; of a slider with a field beside it, the number that both show.
    #[track_caller]
    pub fn number(&self, label: &str) -> f64 {
        let numbers: Vec<f64> =
            self.controls(label).iter().filter_map(|node| node.accesskit_node().numeric_value()).collect();
        assert!(!numbers.is_empty() && numbers.iter().all(|number| *number == numbers[0]), "{label}: {numbers:?}");
        numbers[0]
    }

    /// Moves a slider, as a reader of the screen does.
    #[track_caller]
    pub fn move_slider(&mut self, label: &str, number: f64) {
        self.control_of(Role::Slider, label).set_value_accesskit(number);
        self.frames(2);
    }

    /// Clicks a field of a number, types another and leaves it by Enter.
    #[track_caller]
    pub fn type_number(&mut self, label: &str, number: &str) {
        self.click(label);
        self.type_text(number);
        self.press(Modifiers::NONE, Key::Enter);
    }

    /// Replaces the text of a field.
    #[track_caller]
    pub fn replace_text(&mut self, label: &str, text: &str) {
        self.control(label).focus();
        self.frames(2);
        self.press(Modifiers::COMMAND, Key::A);
        self.type_text(text);
    }

    /// Types into whatever has the focus.
    pub fn type_text(&mut self, text: &str) {
        self.harness.event(eframe::egui::Event::Text(text.to_owned()));
        self.frames(2);
    }

    /// Presses a key and lets it go.
    pub fn press(&mut self, modifiers: Modifiers, key: Key) {
        self.harness.key_press_modifiers(modifiers, key);
        self.frames(2);
    }
}
