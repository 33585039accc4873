//! Output files: written atomically, never over files of others, under names that stay in their
//! folder.
//!
//! Owns the writing of files and the rules of file names. The content belongs to the callers.

mod error;
mod inside;
mod lock;
mod name;
mod output;
mod ownership;
mod partial;
mod read;
mod single;

pub use error::FilesError;
pub use inside::inside;
pub use name::{FileName, NameError, Names};
pub use output::{Output, make_folder};
pub use ownership::{Kind, check, is_own};
pub use read::{read, read_text};
pub use single::{replace, replace_secret};
