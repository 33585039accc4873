use super::ITERATIONS;
use std::panic::AssertUnwindSafe;
use std::time::Duration;
use tokio::runtime::{Builder, Runtime};
use tracktwin_library::{Answer, Cell, Library, LibraryError};

/// Time limit of a query, because a random query could run for ever.
const PATIENCE: Duration = Duration::from_millis(500);

struct Silent;

impl Answer for Silent {
    type Error = LibraryError;

    fn columns(&mut self, _: &[String]) -> Result<(), LibraryError> {
        Ok(())
    }

    fn row(&mut self, _: Vec<Cell>) -> Result<(), LibraryError> {
        Ok(())
    }
}

fn runtime() -> Runtime {
    Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap()
}

#[test]
fn a_question_is_answered_or_refused_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let url = format!("sqlite:{}", folder.path().join("library.sqlite").display());
    let runtime = runtime();
    let library = runtime.block_on(Library::open_or_create(&url)).unwrap();
    let campaigns = || runtime.block_on(library.campaigns()).unwrap().len();
    let (library, runtime) = (AssertUnwindSafe(&library), AssertUnwindSafe(&runtime));
    bolero::check!(name = "questions").with_iterations(ITERATIONS).for_each(|bytes: &[u8]| {
        let text = String::from_utf8_lossy(bytes);
        let asked =
            async { tokio::time::timeout(PATIENCE, library.query(&text, &mut Silent)).await };
        drop(runtime.block_on(asked));
    });
    assert_eq!(campaigns(), 0);
}
