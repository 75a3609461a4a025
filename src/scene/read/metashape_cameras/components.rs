//! Components of a chunk: what could not be connected stands in different ones, each with a transform of its own.

use super::{number_of, numbers, text_of};
use glam::{DMat3, DMat4, DVec3};
use roxmltree::Node;
use std::collections::BTreeMap;

/// The transforms of a chunk.
pub(super) struct Components<'a> {
    /// That of the chunk, which holds for all its cameras.
    whole: Option<DMat4>,
    /// Those of its components by their number.
    own: BTreeMap<&'a str, Option<DMat4>>,
    active: Option<&'a str>,
}

impl<'a> Components<'a> {
    pub(super) fn of(chunk: Node<'a, '_>) -> Self {
        let child = |node: Node<'a, '_>, name: &'static str| node.children().find(|child| child.has_tag_name(name));
        let list = chunk.children().find(|node| node.has_tag_name("components"));
        let nodes = list.into_iter().flat_map(|list| list.children()).filter(|node| node.has_tag_name("component"));
        let own = nodes
            .filter_map(|node| Some((node.attribute("id")?, child(node, "transform").and_then(transform_of))))
            .collect();
        let active = list.and_then(|list| list.attribute("active_id"));
        Components { whole: child(chunk, "transform").and_then(transform_of), own, active }
    }

    /// The component of a camera: the one it names, or else the active one.
    pub(super) fn named(&self, component: Option<&'a str>) -> Option<&'a str> {
        component.filter(|id| self.own.contains_key(id)).or(self.active)
    }

    /// The component with the most cameras; of equals the active one, or the first.
    pub(super) fn with_most(&self, cameras: impl Iterator<Item = Option<&'a str>>) -> Option<&'a str> {
        let mut counts: BTreeMap<Option<&str>, usize> = BTreeMap::new();
        cameras.for_each(|component| *counts.entry(self.named(component)).or_default() += 1);
        let rank = |(component, count): &(Option<&str>, usize)| (*count, *component == self.active);
        let mut best: Option<(Option<&'a str>, usize)> = None;
        for own in counts {
            if best.as_ref().is_none_or(|best| rank(&own) > rank(best)) {
                best = Some(own);
            }
        }
        best.and_then(|(component, _)| component)
    }

    /// What takes cameras of one component into the frame of another.
    pub(super) fn between(&self, main: Option<&'a str>, component: Option<&'a str>) -> Option<DMat4> {
        let component = self.named(component);
        if component == main {
            return Some(DMat4::IDENTITY);
        }
        let of = |id: Option<&str>| self.own.get(id?).copied().flatten();
        Some(of(main)?.inverse() * of(component)?)
    }

    /// `world_from_source` for cameras of a component.
    pub(super) fn transform(&self, component: Option<&'a str>) -> Option<DMat4> {
        self.whole.or_else(|| self.own.get(component?).copied().flatten())
    }
}

/// A similarity: nine numbers of a rotation, a translation, a scale.
fn transform_of(node: Node) -> Option<DMat4> {
    let rotation: [f64; 9] = numbers(text_of(node, "rotation")?)?;
    let translation: [f64; 3] = text_of(node, "translation").and_then(numbers).unwrap_or_default();
    let scale = number_of(node, "scale").unwrap_or(1.0);
    let linear = DMat3::from_cols_array(&rotation).transpose() * scale;
    let matrix = DMat4::from_translation(DVec3::from_array(translation)) * DMat4::from_mat3(linear);
    (matrix.determinant().abs() > 1e-18).then_some(matrix)
}
