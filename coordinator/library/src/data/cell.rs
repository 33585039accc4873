//! A value of any column of any table.

use crate::data::ColumnKind;
use crate::engine::Value;

/// Value of one column in a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// No value.
    Null,
    /// A logical value.
    Boolean(bool),
    /// A text.
    Text(String),
    /// An integer.
    Integer(i64),
    /// A floating-point number.
    Real(f64),
    /// A series of floating-point numbers.
    Doubles(Vec<f64>),
}

impl Cell {
    /// Converts the cell to a value for a column of this type; `None` if it does not fit.
    pub(crate) fn bound_as(self, kind: ColumnKind) -> Option<Value> {
        Some(match (kind, self) {
            (ColumnKind::Text, Self::Null) => Value::Text(None),
            (ColumnKind::Integer, Self::Null) => Value::Integer(None),
            (ColumnKind::Real, Self::Null) => Value::Real(None),
            (ColumnKind::Doubles, Self::Null) => Value::Series(None),
            (ColumnKind::Text, Self::Text(text)) => Value::Text(Some(text)),
            (ColumnKind::Integer, Self::Integer(integer)) => Value::Integer(Some(integer)),
            (ColumnKind::Real, Self::Real(real)) => Value::Real(Some(real)),
            (ColumnKind::Doubles, Self::Doubles(doubles)) => doubles[..].into(),
            _ => return None,
        })
    }
}

impl From<f64> for Cell {
    fn from(real: f64) -> Self {
        Self::Real(real)
    }
}
