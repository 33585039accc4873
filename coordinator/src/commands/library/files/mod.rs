//! Tables as text and as Parquet files; knows nothing of where they come from.

pub(super) mod csv_file;
pub(super) mod parquet_file;
pub(super) mod text;
