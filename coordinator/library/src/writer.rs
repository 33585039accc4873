//! The one task that writes: what arrives together is committed together.
//!
//! `SQLite` has one writer at a time, and a durable commit waits for the disk. So all writes go
//! through one connection, each transaction starts as a writing one (a reading one that becomes a
//! writing one may be refused despite any timeout), and nobody is answered before the commit.

use crate::LibraryError;
use sqlx::{Connection, SqliteConnection};
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use tokio::sync::{Notify, mpsc, oneshot};
use tokio::task::JoinHandle;

/// Writes committed together at most.
///
/// Enough to make the disk's part of each negligible, and few enough that the first waits
/// milliseconds for the last.
const GROUP_MAX: usize = 256;

/// Writes that wait for the writer before those who ask have to wait themselves.
const QUEUE_MAX: usize = 1024;

/// A change to the library, made inside a transaction that others share.
pub(crate) trait Write: Send + Sync + 'static {
    /// What it answers once it is committed.
    type Answer: Send + 'static;

    /// Makes the change. It may be called again after a transaction that failed.
    fn apply(
        &self,
        connection: &mut SqliteConnection,
    ) -> impl Future<Output = Result<Self::Answer, LibraryError>> + Send;
}

/// A handle on the writing task.
pub(crate) struct Writer {
    orders: mpsc::Sender<Box<dyn Order>>,
    closing: Arc<Notify>,
    task: Mutex<Option<JoinHandle<()>>>,
}

impl Writer {
    pub(crate) fn start(connection: SqliteConnection) -> Self {
        let (orders, receiver) = mpsc::channel(QUEUE_MAX);
        let closing = Arc::new(Notify::new());
        let task = tokio::spawn(write_all(connection, receiver, closing.clone()));
        Self { orders, closing, task: Mutex::new(Some(task)) }
    }

    /// Makes a change and waits until it is on the disk.
    pub(crate) async fn write<W: Write>(&self, write: W) -> Result<W::Answer, LibraryError> {
        let (reply, answer) = oneshot::channel();
        let order = Pending { write, answer: None, reply };
        self.orders.send(Box::new(order)).await.map_err(|_| LibraryError::Closed)?;
        answer.await.map_err(|_| LibraryError::Closed)?
    }

    /// Finishes what was ordered and closes the connection.
    pub(crate) async fn close(&self) {
        self.closing.notify_one();
        let task = self.task.lock().expect("nobody panics while holding it").take();
        if let Some(task) = task {
            // A writer that panicked has already failed those who waited for it.
            let _ = task.await;
        }
    }
}

/// An ordered write of any kind.
trait Order: Send {
    fn apply<'a>(
        &'a mut self,
        connection: &'a mut SqliteConnection,
    ) -> Pin<Box<dyn Future<Output = Result<(), LibraryError>> + Send + 'a>>;

    fn reply(self: Box<Self>, committed: Result<(), LibraryError>);
}

struct Pending<W: Write> {
    write: W,
    answer: Option<W::Answer>,
    reply: oneshot::Sender<Result<W::Answer, LibraryError>>,
}

impl<W: Write> Order for Pending<W> {
    fn apply<'a>(
        &'a mut self,
        connection: &'a mut SqliteConnection,
    ) -> Pin<Box<dyn Future<Output = Result<(), LibraryError>> + Send + 'a>> {
        Box::pin(async {
            self.answer = Some(self.write.apply(connection).await?);
            Ok(())
        })
    }

    fn reply(self: Box<Self>, committed: Result<(), LibraryError>) {
        let Self { answer, reply, .. } = *self;
        let answer = committed.map(|()| answer.expect("what is committed was applied"));
        // Who asked may have gone; the write stands all the same.
        let _ = reply.send(answer);
    }
}

async fn write_all(
    mut connection: SqliteConnection,
    mut orders: mpsc::Receiver<Box<dyn Order>>,
    closing: Arc<Notify>,
) {
    let mut group = Vec::new();
    loop {
        tokio::select! {
            biased;
            count = orders.recv_many(&mut group, GROUP_MAX) => if count == 0 { break },
            () = closing.notified() => orders.close(),
        }
        commit_and_reply(&mut connection, &mut group).await;
    }
    // What is committed is on the disk already; closing only tidies the files.
    let _ = connection.close().await;
}

/// Commits a group, or each of it alone where one spoils it for the others.
async fn commit_and_reply(connection: &mut SqliteConnection, group: &mut Vec<Box<dyn Order>>) {
    let together = if group.len() > 1 { commit(connection, group).await.is_ok() } else { false };
    for mut order in group.drain(..) {
        let committed = if together {
            Ok(())
        } else {
            commit(connection, std::slice::from_mut(&mut order)).await
        };
        order.reply(committed);
    }
}

async fn commit(
    connection: &mut SqliteConnection,
    orders: &mut [Box<dyn Order>],
) -> Result<(), LibraryError> {
    let mut transaction = connection.begin_with("begin immediate").await?;
    for order in orders {
        order.apply(&mut transaction).await?;
    }
    Ok(transaction.commit().await?)
}
