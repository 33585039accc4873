//! Files that the program writes: whole or not at all, over nobody else's, under names that stay in
//! their folder.
//!
//! Owns how files come into being and what may stand in a file's name. What the files hold belongs
//! to those who write them.

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
