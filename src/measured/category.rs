//! What kind of thing a MERL material is, told by its name.

/// A kind of material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Category {
    /// Bare metal, and ceramics as hard and bright.
    Metal,
    /// Paint, latex and other coats.
    Paint,
    /// Phenolic resin.
    Phenolic,
    /// Plastic and acrylic.
    Plastic,
    /// Cloth and felt.
    Fabric,
    /// Rubber and foam.
    Rubber,
    /// Wood, most of it varnished.
    Wood,
    /// Stone and mineral.
    Stone,
    /// A name that tells nothing.
    Other,
}

impl Category {
    /// All kinds, in the order of tables.
    pub const ALL: [Category; 9] = [
        Category::Metal,
        Category::Paint,
        Category::Phenolic,
        Category::Plastic,
        Category::Fabric,
        Category::Rubber,
        Category::Wood,
        Category::Stone,
        Category::Other,
    ];

    /// The kind of a material of this name, by the words in it.
    pub fn of(name: &str) -> Self {
        let name = name.to_lowercase();
        let rules: [(Category, &[&str]); 8] = [
            // Paint before metal: "metallic-paint" is a paint. Phenolic before plastic.
            (Category::Paint, &["paint", "latex"]),
            (Category::Phenolic, &["phenolic"]),
            (Category::Fabric, &["fabric", "felt", "velvet", "silk", "nylon"]),
            (Category::Rubber, &["rubber", "foam", "bball"]),
            (
                Category::Plastic,
                &["plastic", "acrylic", "delrin", "polyethylene", "teflon", "pvc", "neoprene", "polyurethane"],
            ),
            (
                Category::Wood,
                &["cherry", "maple", "fruitwood", "pine", "natural-", "oak", "walnut", "birch", "wood", "mahogany"],
            ),
            (
                Category::Stone,
                &["obsidian", "hematite", "jasper", "aventurnine", "marble", "quartz", "alumina", "agate", "stone"],
            ),
            (
                Category::Metal,
                &[
                    "alum", "steel", "brass", "nickel", "chrome", "ss440", "tungsten", "gold", "silicon", "bronze",
                    "copper", "silver",
                ],
            ),
        ];
        let found = rules.iter().find(|(_, words)| words.iter().any(|word| name.contains(word)));
        found.map_or(Category::Other, |(category, _)| *category)
    }

    /// The name for tables.
    pub fn label(self) -> &'static str {
        match self {
            Category::Metal => "metal",
            Category::Paint => "paint",
            Category::Phenolic => "phenolic",
            Category::Plastic => "plastic",
            Category::Fabric => "fabric",
            Category::Rubber => "rubber",
            Category::Wood => "wood",
            Category::Stone => "stone",
            Category::Other => "other",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_the_kind() {
        for (name, category) in [
            ("gold-metallic-paint3", Category::Paint),
            ("silver-paint", Category::Paint),
            ("two-layer-gold", Category::Metal),
            ("specular-black-phenolic", Category::Phenolic),
            ("black-soft-plastic", Category::Plastic),
            ("alumina-oxide", Category::Stone),
            ("aluminium", Category::Metal),
            ("polyurethane-foam", Category::Rubber),
            ("natural-209", Category::Wood),
            ("pink-felt", Category::Fabric),
            ("green-latex", Category::Paint),
            ("x", Category::Other),
        ] {
            assert_eq!(Category::of(name), category, "{name}");
        }
    }
}
