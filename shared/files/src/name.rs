//! File names made from foreign text: names of columns, speeds, campaigns.

use crate::FilesError;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use unicode_normalization::UnicodeNormalization as _;

/// Most bytes of a name: file systems take 255, and suffixes are added to it.
const BYTES_MAX: usize = 100;

/// Bytes of it that are kept where digits of a hash follow.
const BYTES_CUT: usize = 80;

/// Hexadecimal digits of a hash that distinguish two texts with the same name.
const DIGITS: usize = 8;

/// File name for a text without an allowed character.
const NAMELESS: &str = "unnamed";

/// Names reserved for devices by Windows, with any extension.
const DEVICES: [&str; 6] = ["con", "prn", "aux", "nul", "conin$", "conout$"];

/// The name of a file or folder, without its parent folder. All paths from foreign text use this type.
///
/// The name contains letters and digits of any script, spaces, and `. _ - +`. It begins with a letter,
/// digit or underscore and does not end in a dot or space. It is in Unicode NFC, has at most 100 bytes,
/// and is not reserved by an operating system.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FileName(String);

/// Why a text is not a valid file name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// The name is empty or contains only dots.
    #[error("is not a file name; use another name")]
    Empty,
    /// The name is too long.
    #[error("is longer than {BYTES_MAX} bytes; use a shorter name")]
    Long,
    /// The name contains a character that is not allowed.
    #[error(
        "contains {0:?}; use letters, digits, spaces and . _ - +, and start with a letter \
             or digit"
    )]
    Character(char),
    /// An operating system reserves the name.
    #[error("is a reserved name of an operating system; use another name")]
    Reserved,
    /// The name is not in Unicode NFC: letters are decomposed into base letter and accent.
    #[error("contains decomposed letters; use composed letters (Unicode NFC)")]
    Decomposed,
}

impl FileName {
    /// Checks a text and returns it as a name.
    ///
    /// # Errors
    /// [`FilesError::Name`] states the fault of the text.
    pub fn new(text: &str) -> Result<Self, FilesError> {
        match fault(text) {
            None => Ok(Self(text.to_owned())),
            Some(fault) => Err(FilesError::Name { name: shown(text), fault }),
        }
    }

    /// Splits a path from the user into folder and file name. The name needs only to be that of a file;
    /// the rules for foreign text do not apply.
    ///
    /// # Errors
    /// [`FilesError::Name`] for a path without a file name, such as `..` or `/`.
    pub fn of_path(path: &Path) -> Result<(PathBuf, Self), FilesError> {
        // A link stays, and what it leads to is written.
        let real = if path.is_symlink() { path.canonicalize().ok() } else { None };
        let path = real.as_deref().unwrap_or(path);
        let name = path.file_name().and_then(|name| name.to_str()).ok_or_else(|| {
            FilesError::Name { name: shown(&path.to_string_lossy()), fault: NameError::Empty }
        })?;
        Ok((crate::partial::folder_of(path).to_owned(), Self(name.to_owned())))
    }

    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The path of the file in a folder.
    pub fn within(&self, folder: &Path) -> PathBuf {
        folder.join(&self.0)
    }

    /// The name with a file extension of the program appended.
    #[must_use]
    pub fn with_ending(&self, ending: &'static str) -> Self {
        Self(format!("{}.{ending}", self.0))
    }

    /// The name with the first digits of a hash before its extension.
    #[must_use]
    pub(crate) fn marked(&self, hash: &str) -> Self {
        let digits = &hash[..DIGITS.min(hash.len())];
        match self.0.rsplit_once('.') {
            Some((stem, ending)) if !stem.is_empty() => Self(format!("{stem}-{digits}.{ending}")),
            _ => Self(format!("{}-{digits}", self.0)),
        }
    }
}

impl std::fmt::Display for FileName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

/// Makes file names from texts. The names are unique within a folder, also without regard to upper and
/// lower case.
#[derive(Clone, Debug, Default)]
pub struct Names {
    taken: HashSet<String>,
}

impl Names {
    /// A name like `text`: characters that are not allowed become underscores. If two texts would
    /// have the same name, the second gets digits of its hash.
    pub fn make(&mut self, text: &str) -> FileName {
        let mut name = like(text);
        let mut attempt = 0_u32;
        while !self.taken.insert(name.to_lowercase()) {
            attempt += 1;
            let hash = blake3::hash(format!("{text}\0{attempt}").as_bytes()).to_hex();
            name = format!("{}-{}", within_bytes(&like(text), BYTES_CUT), &hash[..DIGITS]);
        }
        FileName(name)
    }
}

/// The longest name that looks like a text.
fn like(text: &str) -> String {
    let mut name = String::new();
    for c in text.nfc() {
        match c {
            c if is_usual(c) => name.push(c),
            // One for several: `/'ABA'/'acc_l'` is ABA_acc_l.
            _ if name.ends_with('_') => {}
            _ => name.push('_'),
        }
    }
    let name = name.trim_matches(|c: char| !c.is_alphanumeric());
    let mut name = within_bytes(name, BYTES_MAX).to_owned();
    name.truncate(name.trim_end_matches(['.', ' ']).len());
    if name.is_empty() {
        NAMELESS.clone_into(&mut name);
    }
    if is_reserved(&name) {
        name.insert(0, '_');
    }
    name
}

fn within_bytes(text: &str, bytes: usize) -> &str {
    &text[..text.floor_char_boundary(bytes)]
}

fn is_usual(c: char) -> bool {
    c.is_alphanumeric() || " ._-+".contains(c)
}

fn fault(text: &str) -> Option<NameError> {
    if text.trim_matches(['.', ' ']).is_empty() {
        return Some(NameError::Empty);
    }
    if text.len() > BYTES_MAX {
        return Some(NameError::Long);
    }
    if let Some(wrong) = text.chars().find(|&c| !is_usual(c)) {
        return Some(NameError::Character(wrong));
    }
    if let Some(first) = text.chars().next().filter(|&c| !c.is_alphanumeric() && c != '_') {
        return Some(NameError::Character(first));
    }
    if let Some(last) = text.chars().next_back().filter(|c| ". ".contains(*c)) {
        return Some(NameError::Character(last));
    }
    if !unicode_normalization::is_nfc(text) {
        return Some(NameError::Decomposed);
    }
    is_reserved(text).then_some(NameError::Reserved)
}

fn is_reserved(name: &str) -> bool {
    let stem = name.split('.').next().unwrap_or(name).trim_end().to_lowercase();
    let numbered = |device: &str| {
        stem.strip_prefix(device).is_some_and(|rest| {
            rest.chars().count() == 1
                && rest.chars().all(|c| c.is_ascii_digit() || "¹²³".contains(c))
        })
    };
    DEVICES.contains(&stem.as_str()) || numbered("com") || numbered("lpt")
}

/// The beginning of a text, for a message.
fn shown(text: &str) -> String {
    within_bytes(text, BYTES_MAX).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn foreign_names_become_names_of_files() {
        for (text, name) in [
            ("acc", "acc"),
            ("/x/a", "x_a"),
            ("../a", "a"),
            ("/'ABA'/'acc_l'", "ABA_acc_l"),
            ("..", NAMELESS),
            ("", NAMELESS),
            (".hidden", "hidden"),
            ("-rf", "rf"),
            ("a\u{202e}b\0c\nd", "a_b_c_d"),
            ("con.csv", "_con.csv"),
            ("COM1", "_COM1"),
            ("Beschl. [m/s²]", "Beschl. _m_s²"),
            ("u\u{308}ber", "über"),
            ("加速度", "加速度"),
        ] {
            assert_eq!(Names::default().make(text).as_str(), name, "{text:?}");
        }
    }

    #[test]
    fn two_texts_never_have_one_name() {
        let mut names = Names::default();
        let texts = ["a/b", "a_b", "A/B", "a:b", "a/b", "a/b", &"x".repeat(300), &"x".repeat(301)];
        let made: HashSet<String> =
            texts.iter().map(|text| names.make(text).as_str().to_lowercase()).collect();
        assert_eq!(made.len(), texts.len(), "{made:?}");
    }

    #[test]
    fn what_is_no_name_is_refused_with_the_reason() {
        let refused = |text: &str| match FileName::new(text).unwrap_err() {
            FilesError::Name { fault, .. } => fault,
            other => panic!("{other}"),
        };
        for text in ["", ".", "..", " "] {
            assert_eq!(refused(text), NameError::Empty);
        }
        assert_eq!(refused("a/b"), NameError::Character('/'));
        assert_eq!(refused("a\\b"), NameError::Character('\\'));
        assert_eq!(refused(".a"), NameError::Character('.'));
        assert_eq!(refused("a\0"), NameError::Character('\0'));
        assert_eq!(refused("NUL.txt"), NameError::Reserved);
        assert_eq!(refused(&"a".repeat(101)), NameError::Long);
        // A letter and a combining mark that is a letter of its own: Unicode's composition exists.
        assert_eq!(refused("\u{1100}\u{1161}"), NameError::Decomposed);
    }

    proptest! {
        #[test]
        fn whatever_is_made_is_a_name_and_stays_in_its_folder(texts in prop::collection::vec(".*", 1..8)) {
            let mut names = Names::default();
            for text in &texts {
                let name = names.make(text);
                prop_assert_eq!(fault(name.as_str()), None, "{:?}", name);
                let path = name.within(Path::new("/f"));
                prop_assert_eq!(path.parent(), Some(Path::new("/f")));
            }
        }
    }
}
