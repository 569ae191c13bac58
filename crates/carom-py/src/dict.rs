//! Dicts in one statement.

/// A dict of these entries.
macro_rules! dict {
    ($py:expr, $($name:literal: $value:expr),+ $(,)?) => {{
        let out = pyo3::types::PyDict::new($py);
        $(out.set_item($name, $value)?;)+
        out
    }};
}
pub(crate) use dict;
