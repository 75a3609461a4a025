//! Dependencies point one way: a lower layer never imports a higher one.

use std::path::Path;

/// Rank of each top-level module. A module may use modules of lower rank, and of its own rank only where listed.
const RANKS: [(&str, usize); 21] = [
    ("error", 0),
    ("files", 0),
    ("guide", 0),
    ("math", 1),
    ("image", 2),
    ("trace", 3),
    ("light", 3),
    ("material", 3),
    ("scene", 4),
    ("measured", 4),
    ("atlas", 5),
    ("neural", 5),
    ("render", 6),
    ("fit", 7),
    ("insight", 8),
    ("export", 8),
    ("object", 8),
    ("job", 9),
    ("cli", 10),
    ("studio", 10),
    ("lab", 11),
];
/// Pairs of the same rank in which the first may use the second.
const ALLOWED_SIBLINGS: [(&str, &str); 6] = [
    ("files", "error"),
    ("guide", "error"),
    ("material", "light"),
    ("insight", "export"),
    ("object", "insight"),
    ("cli", "studio"),
];

fn rank(module: &str) -> Option<usize> {
    RANKS.iter().find(|(name, _)| *name == module).map(|(_, rank)| *rank)
}

fn check_folder(folder: &Path, module: &str, violations: &mut Vec<String>, files: &mut usize) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            check_folder(&path, module, violations, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            *files += 1;
            check_file(&path, module, violations);
        }
    }
}

fn check_file(path: &Path, module: &str, violations: &mut Vec<String>) {
    let text = std::fs::read_to_string(path).unwrap();
    for (number, line) in text.lines().enumerate() {
        let code = line.trim_start();
        if code.starts_with("//") {
            continue;
        }
        for piece in code.split("crate::").skip(1) {
            let used: String = piece.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            let (Some(own), Some(other)) = (rank(module), rank(&used)) else { continue };
            let sibling = used == module || ALLOWED_SIBLINGS.contains(&(module, used.as_str()));
            if other > own || (other == own && !sibling) {
                violations.push(format!("{}:{}: {module} uses {used}", path.display(), number + 1));
            }
        }
    }
}

#[test]
fn lower_layers_never_import_higher_ones() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut violations = Vec::new();
    let mut files = 0;
    for (module, _) in RANKS {
        let folder = source.join(module);
        if folder.is_dir() {
            check_folder(&folder, module, &mut violations, &mut files);
        }
        let file = source.join(format!("{module}.rs"));
        if file.is_file() {
            files += 1;
            check_file(&file, module, &mut violations);
        }
    }
    assert!(files > 10, "the walk found only {files} files");
    assert!(violations.is_empty(), "layers are crossed:\n{}", violations.join("\n"));
}

#[test]
fn every_module_of_the_library_has_a_rank() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs");
    let mut modules = 0;
    for line in std::fs::read_to_string(source).unwrap().lines() {
        let line = line.trim();
        let Some(module) = line.strip_prefix("pub ").unwrap_or(line).strip_prefix("mod ") else { continue };
        // One that is written out there holds names of others alone.
        let Some(module) = module.strip_suffix(';') else { continue };
        modules += 1;
        assert!(module.ends_with("_tests") || rank(module).is_some(), "module {module} has no rank here");
    }
    assert!(modules > 10, "the front page declares only {modules} modules");
}
