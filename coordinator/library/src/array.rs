//! The table `stored_array`: series of numbers that are expensive to compute.

use crate::engine::{Connection, Write, sql};
use crate::library::Dated;
use crate::{Library, LibraryError};

/// Stores a series; an existing one is kept unchanged.
const INSERT: &str = "
    insert into stored_array (key, kind, meta, numbers, created_at) values ($1, $2, $3, $4, $5)
    on conflict (key) do nothing";

/// A stored series of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredArray {
    /// Hash of all inputs that determine the numbers.
    pub key: String,
    /// Kind of series, e.g. `null-campaign`.
    pub kind: String,
    /// Shape and units of the numbers, as JSON.
    pub meta_json: String,
    /// The numbers, in the shape and units of `meta_json`.
    pub numbers: Vec<f64>,
}

impl Library {
    /// Stores a series. An existing series with the same key is kept unchanged.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be written.
    pub async fn store_array(&self, array: StoredArray) -> Result<(), LibraryError> {
        self.write_dated(array).await
    }

    /// Returns the series with this key; `None` if there is none.
    ///
    /// # Errors
    /// [`LibraryError`] when the library cannot be read.
    pub async fn array(&self, key: &str) -> Result<Option<StoredArray>, LibraryError> {
        let ask = sql("select * from stored_array where key = $1").bind(key);
        let Some(row) = self.readers().row(ask).await? else { return Ok(None) };
        Ok(Some(StoredArray {
            key: row.get("key")?,
            kind: row.get("kind")?,
            meta_json: row.get("meta")?,
            numbers: row.doubles("numbers")?,
        }))
    }
}

impl Write for Dated<StoredArray> {
    type Answer = ();

    async fn apply(&self, connection: &mut Connection) -> Result<(), LibraryError> {
        let insert = sql(INSERT)
            .bind(&self.it.key)
            .bind(&self.it.kind)
            .bind(&self.it.meta_json)
            .bind(&self.it.numbers[..])
            .bind(&self.at);
        connection.execute(insert).await.map(drop)
    }
}
