//! Logging macro that expands to nothing without the `defmt` feature, as on the host.

/// Logs at a level of `defmt`.
macro_rules! log {
    ($level:ident, $text:literal $(, $value:expr)* $(,)?) => {{
        #[cfg(feature = "defmt")]
        ::defmt::$level!($text $(, $value)*);
        #[cfg(not(feature = "defmt"))]
        { let _ = ($(&$value,)*); }
    }};
}

pub(crate) use log;
