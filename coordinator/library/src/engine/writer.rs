//! The writing tasks. Writes that arrive together are committed together.
//!
//! A durable commit waits for the disk, and `SQLite` has one writer at a time. So all writes of a process
//! go through one connection. With PostgreSQL there are a few connections: while one waits for the disk,
//! another fills its transaction. A caller gets its result after the commit. A lost server is retried for a
//! limited time.

use super::clock::Clock;
use super::retry_budget::RetryBudget;
use super::writer_shards::{Slot, WriterShards};
use super::{Connection, Target, postgres};
use crate::LibraryError;
use parking_lot::Mutex;
use std::pin::Pin;
use std::sync::{Arc, OnceLock};
use std::time::Duration;
use tokio::sync::{Notify, mpsc, oneshot};
use tokio::task::JoinHandle;

/// Maximum number of writes that are committed together.
///
/// It is large enough to make the disk time per write negligible. It is small enough that the first write
/// waits only milliseconds for the last.
const GROUP_MAX: usize = 256;

/// Maximum number of queued writes. Further callers wait until there is space in the queue.
const QUEUE_MAX: usize = 1024;

/// A query or a transaction that takes longer is treated as a lost connection, even if the network
/// reports no error.
pub(super) const SERVER_TIMEOUT: Duration = Duration::from_mins(1);

/// Number of connections that write to a server.
const SERVER_SHARDS: usize = 2;

/// A change to the library, made in a transaction that it may share with others.
pub(crate) trait Write: Send + Sync + 'static {
    /// Result of the committed write.
    type Answer: Send + 'static;

    /// Worker whose rows this write changes. Writes of one worker are serialized; writes without a
    /// worker share one queue.
    fn worker(&self) -> Option<&str> {
        None
    }

    /// Makes the change. It may be called again if the transaction failed or its success is unknown.
    fn apply(
        &self,
        connection: &mut Connection,
    ) -> impl Future<Output = Result<Self::Answer, LibraryError>> + Send;
}

/// Handle of the writing tasks.
pub(crate) struct Writer {
    tasks: Vec<Task>,
    shards: WriterShards,
}

struct Task {
    requests: mpsc::Sender<Box<dyn WriteRequest>>,
    closing: Arc<Notify>,
    handle: Mutex<Option<JoinHandle<()>>>,
    /// Error that broke the connection to a file, if it ended the task.
    lost: Arc<OnceLock<String>>,
}

impl Writer {
    /// Starts the tasks. A task without a connection opens one at its first write.
    pub(super) fn start(
        target: &Target,
        connection: Option<Connection>,
        clock: &Arc<Clock>,
    ) -> Self {
        let count = match target {
            Target::Sqlite(_) => 1,
            Target::Postgres { .. } => SERVER_SHARDS,
        };
        let connections = std::iter::once(connection).chain(std::iter::repeat_with(|| None));
        let session = |connection| Session {
            target: target.clone(),
            connection,
            clock: clock.clone(),
            retries: true,
            lost: Arc::default(),
        };
        let tasks = connections.take(count).map(|it| Task::start(session(it))).collect();
        Self { tasks, shards: WriterShards::new(count) }
    }

    /// Makes a change and returns after the change is on the disk.
    pub(crate) async fn write<W: Write>(&self, write: W) -> Result<W::Answer, LibraryError> {
        let (responder, answer) = oneshot::channel();
        let slot = self.shards.enter(write.worker().unwrap_or_default());
        let task = &self.tasks[slot.number()];
        let request = Pending { write, answer: None, responder, _slot: slot };
        task.requests.send(Box::new(request)).await.map_err(|_| task.end())?;
        answer.await.map_err(|_| task.end())?
    }

    /// Checks that all tasks can write. A task stops writing after a panic, after closing, or after the
    /// connection to its file was lost.
    ///
    /// # Errors
    /// Returns the cause: [`LibraryError::Closed`] or [`LibraryError::Lost`].
    pub(crate) fn runs(&self) -> Result<(), LibraryError> {
        self.tasks.iter().try_for_each(|task| if task.runs() { Ok(()) } else { Err(task.end()) })
    }

    /// Finishes the queued writes and closes the connections.
    pub(crate) async fn close(&self) {
        for task in &self.tasks {
            task.closing.notify_one();
        }
        for task in &self.tasks {
            let handle = task.handle.lock().take();
            if let Some(handle) = handle {
                // A writer that panicked has already failed those who waited for it.
                let _ = handle.await;
            }
        }
    }
}

impl Task {
    fn start(session: Session) -> Self {
        let (requests, receiver) = mpsc::channel(QUEUE_MAX);
        let closing = Arc::new(Notify::new());
        let lost = session.lost.clone();
        let handle = tokio::spawn(write_all(session, receiver, closing.clone()));
        Self { requests, closing, handle: Mutex::new(Some(handle)), lost }
    }

    /// Error that explains why the task no longer writes.
    fn end(&self) -> LibraryError {
        match self.lost.get() {
            Some(reason) => LibraryError::Lost { reason: reason.clone() },
            None => LibraryError::Closed,
        }
    }

    fn runs(&self) -> bool {
        let handle = self.handle.lock();
        handle.as_ref().is_some_and(|handle| !handle.is_finished())
    }
}

/// A queued write of any type.
trait WriteRequest: Send {
    fn apply<'a>(
        &'a mut self,
        connection: &'a mut Connection,
    ) -> Pin<Box<dyn Future<Output = Result<(), LibraryError>> + Send + 'a>>;

    fn respond(self: Box<Self>, committed: Result<(), LibraryError>);
}

struct Pending<W: Write> {
    write: W,
    answer: Option<W::Answer>,
    responder: oneshot::Sender<Result<W::Answer, LibraryError>>,
    /// Kept until the write is done, even if the caller no longer waits.
    _slot: Slot,
}

impl<W: Write> WriteRequest for Pending<W> {
    fn apply<'a>(
        &'a mut self,
        connection: &'a mut Connection,
    ) -> Pin<Box<dyn Future<Output = Result<(), LibraryError>> + Send + 'a>> {
        Box::pin(async {
            self.answer = Some(self.write.apply(connection).await?);
            Ok(())
        })
    }

    fn respond(self: Box<Self>, committed: Result<(), LibraryError>) {
        let Self { answer, responder, .. } = *self;
        let answer = committed.map(|()| answer.expect("what is committed was applied"));
        // The caller may have gone; the write is committed nevertheless.
        let _ = responder.send(answer);
    }
}

async fn write_all(
    mut session: Session,
    mut requests: mpsc::Receiver<Box<dyn WriteRequest>>,
    closing: Arc<Notify>,
) {
    let mut group = Vec::new();
    loop {
        tokio::select! {
            biased;
            count = requests.recv_many(&mut group, GROUP_MAX) => if count == 0 { break },
            () = closing.notified() => requests.close(),
        }
        // Closing is no change, and begins no transaction.
        if !group.is_empty() {
            session.commit_and_respond(&mut group).await;
        }
        if session.lost.get().is_some() {
            break;
        }
    }
    if let Some(connection) = session.connection {
        connection.close().await;
    }
}

/// State of a writing task; it outlasts single connections.
struct Session {
    target: Target,
    connection: Option<Connection>,
    /// Clock of the library. The session updates it, because it has a connection to the server.
    clock: Arc<Clock>,
    /// Whether to retry an unavailable database. False from the time at which the retry budget is used up
    /// until the database responds again.
    retries: bool,
    /// Error that broke the connection to a file. The file is not opened again, because its state is
    /// unknown. Nothing can be written any more; a supervisor should restart the program.
    lost: Arc<OnceLock<String>>,
}

impl Session {
    /// Drops a broken connection. For a file, returns the error for the waiting writes.
    fn disconnect(&mut self, error: &LibraryError) -> Result<(), LibraryError> {
        self.connection = None;
        if matches!(self.target, Target::Postgres { .. }) {
            return Ok(());
        }
        let reason = self.lost.get_or_init(|| error.to_string()).clone();
        let lost = LibraryError::Lost { reason };
        tracing::error!("{lost}");
        Err(lost)
    }

    /// Commits a group of writes. If one of them makes the commit fail, commits each write separately.
    async fn commit_and_respond(&mut self, group: &mut Vec<Box<dyn WriteRequest>>) {
        match self.commit(group).await {
            Ok(()) => group.drain(..).for_each(|request| request.respond(Ok(()))),
            Err(LibraryError::Unavailable { reason }) => {
                let away = || LibraryError::Unavailable { reason: reason.clone() };
                group.drain(..).for_each(|request| request.respond(Err(away())));
            }
            Err(LibraryError::Lost { reason }) => {
                let lost = || LibraryError::Lost { reason: reason.clone() };
                group.drain(..).for_each(|request| request.respond(Err(lost())));
            }
            Err(error) => match group.pop() {
                Some(request) if group.is_empty() => request.respond(Err(error)),
                last => {
                    for mut request in group.drain(..).chain(last) {
                        let alone = self.commit(std::slice::from_mut(&mut request)).await;
                        request.respond(alone);
                    }
                }
            },
        }
    }

    /// Commits these writes together. Retries an unavailable database.
    async fn commit(&mut self, requests: &mut [Box<dyn WriteRequest>]) -> Result<(), LibraryError> {
        let mut budget = RetryBudget::new(self.retries);
        loop {
            match self.try_to_commit(requests).await {
                Err(error) if error.is_unavailable() => {
                    self.disconnect(&error)?;
                    if budget.wait().await.is_err() {
                        self.retries = false;
                        return Err(error);
                    }
                }
                done => {
                    self.retries = true;
                    return done;
                }
            }
        }
    }

    async fn try_to_commit(
        &mut self,
        requests: &mut [Box<dyn WriteRequest>],
    ) -> Result<(), LibraryError> {
        let connection = match (&mut self.connection, &self.target) {
            (Some(connection), _) => connection,
            (none, Target::Postgres { options, .. }) => {
                none.insert(postgres::connect(options).await?)
            }
            (None, Target::Sqlite(_)) => return Err(LibraryError::Closed),
        };
        let clock = &self.clock;
        let transaction = async {
            if let Connection::Postgres(server) = connection
                && clock.is_old()
            {
                clock.set(postgres::unix_ms(server).await?);
            }
            transaction(connection, requests).await
        };
        match &self.target {
            Target::Sqlite(_) => transaction.await,
            Target::Postgres { .. } => tokio::time::timeout(SERVER_TIMEOUT, transaction)
                .await
                .unwrap_or_else(|_| Err(LibraryError::silent(SERVER_TIMEOUT))),
        }
    }
}

async fn transaction(
    connection: &mut Connection,
    requests: &mut [Box<dyn WriteRequest>],
) -> Result<(), LibraryError> {
    connection.begin().await?;
    let mut done = Ok(());
    for request in requests {
        done = request.apply(connection).await;
        if done.is_err() {
            break;
        }
    }
    if done.is_ok() {
        done = connection.commit().await;
    }
    if done.is_err() {
        connection.rollback().await;
    }
    done
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Breaks;

    impl Write for Breaks {
        type Answer = ();

        async fn apply(&self, _: &mut Connection) -> Result<(), LibraryError> {
            panic!("a fault of the program")
        }
    }

    /// A write whose error is that of a connection whose thread has ended.
    struct Crashes;

    impl Write for Crashes {
        type Answer = ();

        async fn apply(&self, _: &mut Connection) -> Result<(), LibraryError> {
            Err(sqlx::Error::WorkerCrashed.into())
        }
    }

    #[tokio::test]
    async fn a_file_whose_connection_is_lost_takes_no_more_writes_and_says_so() {
        let folder = tempfile::tempdir().unwrap();
        let url = format!("sqlite:{}", folder.path().join("library.sqlite").display());
        let writer = crate::engine::open_or_create(&url).await.unwrap().writer;
        let error = writer.write(Crashes).await.unwrap_err();
        assert!(matches!(error, LibraryError::Lost { .. }), "{error:?}");
        assert!(!error.is_temporary() && !error.is_wrong_input(), "it is fatal");
        let again = writer.write(Crashes).await;
        assert!(matches!(again, Err(LibraryError::Lost { .. })), "{again:?}");
        tokio::task::yield_now().await;
        assert!(matches!(writer.runs(), Err(LibraryError::Lost { .. })));
    }

    #[tokio::test]
    async fn a_task_that_breaks_down_is_known_to_have_ended() {
        let folder = tempfile::tempdir().unwrap();
        let url = format!("sqlite:{}", folder.path().join("library.sqlite").display());
        let writer = crate::engine::open_or_create(&url).await.unwrap().writer;
        assert!(writer.runs().is_ok());
        assert!(matches!(writer.write(Breaks).await, Err(LibraryError::Closed)));
        tokio::task::yield_now().await;
        assert!(writer.runs().is_err());
    }
}
