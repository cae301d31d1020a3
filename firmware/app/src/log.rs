//! Log macros that vanish where the `defmt` feature is off, as on the host. Transitions are logged, never samples.

macro_rules! info {
    ($text:literal $(, $x:expr)* $(,)?) => {{
        #[cfg(feature = "defmt")]
        ::defmt::info!($text $(, $x)*);
        #[cfg(not(feature = "defmt"))]
        { let _ = ($(&$x,)*); }
    }};
}

macro_rules! warning {
    ($text:literal $(, $x:expr)* $(,)?) => {{
        #[cfg(feature = "defmt")]
        ::defmt::warn!($text $(, $x)*);
        #[cfg(not(feature = "defmt"))]
        { let _ = ($(&$x,)*); }
    }};
}

pub(crate) use {info, warning};
