//! Tables as text and Parquet files, independent of their source.

pub(super) mod csv_file;
pub(super) mod parquet_file;
pub(super) mod text;
