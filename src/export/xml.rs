//! Tests shared by the formats that write XML.

pub(super) mod tests {
    /// Fails unless every tag is closed by its own name, in order.
    pub fn tags_are_balanced(text: &str) {
        let mut open: Vec<String> = Vec::new();
        for piece in text.split('<').skip(1) {
            let tag = piece.split('>').next().unwrap();
            if tag.starts_with('?') || tag.starts_with('!') {
                continue;
            }
            let name: String =
                tag.trim_start_matches('/').chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            if tag.starts_with('/') {
                assert_eq!(open.pop().as_deref(), Some(name.as_str()), "{text}");
            } else {
                assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
                if !tag.ends_with('/') {
                    open.push(name);
                }
            }
        }
        assert!(open.is_empty(), "{open:?}");
    }
}
