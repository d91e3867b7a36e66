//! Words of a shell, for commands in messages that users copy.

use std::path::Path;

/// A text as one word of a shell.
pub fn word(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./=:,+@%".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

/// A path as one word of a shell. Bytes that are not UTF-8 are replaced.
pub fn path(path: &Path) -> String {
    word(&path.to_string_lossy())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn word_of_a_shell_is_quoted_where_necessary() {
        assert_eq!(word("run.drive=drives/a_b"), "run.drive=drives/a_b");
        assert_eq!(word("a.b=[\"it's\"]"), "'a.b=[\"it'\\''s\"]'");
        assert_eq!(path(Path::new("drives/monday morning")), "'drives/monday morning'");
        assert_eq!(word(""), "''");
    }
}
