//! Reading of small files as a whole: descriptions, configurations and manifests, not recordings.

use crate::FilesError;
use std::fs::File;
use std::io::{Error, ErrorKind, Read as _};
use std::path::Path;

/// Upper limit of the size in bytes; a pipe or device may be endless.
const BYTES_MAX: u64 = 64 << 20;

/// The content of a file of at most 64 MiB.
///
/// # Errors
/// [`FilesError::System`] if the file cannot be read or is larger.
pub fn read(path: &Path) -> Result<Vec<u8>, FilesError> {
    let read = || {
        let mut bytes = Vec::new();
        File::open(path)?.take(BYTES_MAX + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > BYTES_MAX {
            let large = format!(
                "the file is larger than {} MiB; check that it is the right file",
                BYTES_MAX >> 20
            );
            return Err(Error::new(ErrorKind::InvalidInput, large));
        }
        Ok(bytes)
    };
    read().map_err(FilesError::system(path, "read"))
}

/// The content of a text file of at most 64 MiB.
///
/// # Errors
/// The errors of [`read`]; also if the file is not UTF-8.
pub fn read_text(path: &Path) -> Result<String, FilesError> {
    String::from_utf8(read(path)?).map_err(|error| {
        let error = Error::new(ErrorKind::InvalidInput, format!("the file is not text ({error})"));
        FilesError::system(path, "read")(error)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_end_is_not_read_for_ever() {
        let endless = read(Path::new("/dev/zero")).unwrap_err();
        assert!(endless.is_wrong_input() && endless.to_string().contains("larger than 64 MiB"));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("text");
        std::fs::write(&path, [0xff, 0xfe]).unwrap();
        assert!(read_text(&path).unwrap_err().to_string().contains("not text"));
        std::fs::write(&path, "text").unwrap();
        assert_eq!(read_text(&path).unwrap(), "text");
    }
}
