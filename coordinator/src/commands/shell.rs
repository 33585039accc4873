//! Words of a command as a shell reads them, for commands that are printed to be copied.

use std::path::Path;

/// The word itself if a shell reads it as one, else within single quotes.
pub(super) fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// The path as a word of a command.
pub(super) fn quoted_path(path: &Path) -> String {
    quoted(&path.display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_shell_would_split_or_replace_is_quoted() {
        for plain in ["out/Fahrt-2.1", "sqlite:library.sqlite", "/daten/Gleis_Süd"] {
            assert_eq!(quoted(plain), plain);
        }
        for (word, expected) in [
            ("day 1", "'day 1'"),
            ("it's", r"'it'\''s'"),
            ("$HOME", "'$HOME'"),
            ("~/a", "'~/a'"),
            ("", "''"),
        ] {
            assert_eq!(quoted(word), expected);
        }
        assert_eq!(quoted_path(Path::new("my runs/a")), "'my runs/a'");
    }
}
