//! Output files. They are written atomically, do not replace files of other programs, and have names
//! that stay in their folder.
//!
//! This crate writes files and defines the rules of file names. The callers provide the content.

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
