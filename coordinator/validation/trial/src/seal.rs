//! Seals. They fix the truth before any diagnosis, and every reader can verify this.

use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write;

/// SHA-256 of every sealed file, by its name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Seals(BTreeMap<String, String>);

/// A seal is broken or missing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SealError {
    /// A file was never sealed.
    #[error("{0}: not sealed; the trial was started without it")]
    NotSealed(String),
    /// The content of a file differs from the sealed content.
    #[error("{0}: changed after sealing; start a new trial in another folder")]
    Broken(String),
    /// A line of the file of seals can't be read.
    #[error("seals: `{0}` is not a line of `sha256sum`; start a new trial in another folder")]
    Line(String),
}

impl Seals {
    /// Seals the content of a file.
    pub fn seal(&mut self, name: &str, content: &[u8]) {
        self.0.insert(name.to_owned(), sha256(content));
    }

    /// Checks that the content of a file equals the sealed content.
    ///
    /// # Errors
    /// [`SealError::NotSealed`] or [`SealError::Broken`] with the name of the file.
    pub fn open(&self, name: &str, content: &[u8]) -> Result<(), SealError> {
        match self.0.get(name) {
            None => Err(SealError::NotSealed(name.to_owned())),
            Some(sealed) if *sealed == sha256(content) => Ok(()),
            Some(_) => Err(SealError::Broken(name.to_owned())),
        }
    }

    /// Checks that both sets of seals agree for all files that they have in common.
    ///
    /// # Errors
    /// [`SealError::Broken`] names the first file that differs.
    pub fn agree(&self, other: &Self) -> Result<(), SealError> {
        let differs = |(name, digest): &(&String, &String)| {
            other.0.get(*name).is_some_and(|other| other != *digest)
        };
        match self.0.iter().find(differs) {
            Some((name, _)) => Err(SealError::Broken(name.clone())),
            None => Ok(()),
        }
    }

    /// The SHA-256 of each file, by name.
    pub fn digests(&self) -> impl Iterator<Item = &str> {
        self.0.values().map(String::as_str)
    }

    /// Number of sealed files.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// The seals in the format of `sha256sum`, for `sha256sum -c`.
    pub fn to_text(&self) -> String {
        self.0.iter().fold(String::new(), |text, (name, digest)| text + digest + "  " + name + "\n")
    }

    /// Reads seals in the format of `sha256sum`.
    ///
    /// # Errors
    /// [`SealError::Line`] names the invalid line.
    pub fn from_text(text: &str) -> Result<Self, SealError> {
        let line = |line: &str| match line.split_once("  ") {
            Some((digest, name)) if digest.len() == 64 => Ok((name.to_owned(), digest.to_owned())),
            _ => Err(SealError::Line(line.to_owned())),
        };
        text.lines().map(line).collect::<Result<_, _>>().map(Self)
    }

    /// SHA-256 of all seals. Its publication before the diagnosis proves that no truth was changed.
    pub fn digest(&self) -> String {
        sha256(self.to_text().as_bytes())
    }
}

fn sha256(content: &[u8]) -> String {
    Sha256::digest(content).iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").expect("a string takes all that is written");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digests_are_those_of_the_standard() {
        // FIPS 180-4, the message "abc".
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256(b"abc"), expected);
    }

    #[test]
    fn a_longer_trial_agrees_with_a_shorter_one_of_the_same_truths() {
        let sealed = |contents: &[&[u8]]| {
            let mut seals = Seals::default();
            for (number, content) in contents.iter().enumerate() {
                seals.seal(&number.to_string(), content);
            }
            seals
        };
        let shorter = sealed(&[b"squat"]);
        assert_eq!(sealed(&[b"squat", b"joint"]).agree(&shorter), Ok(()));
        assert_eq!(shorter.agree(&sealed(&[b"squat", b"joint"])), Ok(()));
        let broken = SealError::Broken("0".to_owned());
        assert_eq!(sealed(&[b"joint"]).agree(&shorter), Err(broken));
    }

    #[test]
    fn a_changed_truth_breaks_its_seal() {
        let mut seals = Seals::default();
        seals.seal("sealed/0001.json", b"squat");
        let seals = Seals::from_text(&seals.to_text()).unwrap();
        assert_eq!(seals.open("sealed/0001.json", b"squat"), Ok(()));
        let broken = SealError::Broken("sealed/0001.json".to_owned());
        assert_eq!(seals.open("sealed/0001.json", b"joint"), Err(broken));
        let unknown = SealError::NotSealed("sealed/0002.json".to_owned());
        assert_eq!(seals.open("sealed/0002.json", b"squat"), Err(unknown));
        assert!(Seals::from_text("deadbeef sealed").is_err());
    }
}
