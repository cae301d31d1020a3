//! Measurement classes of ISO 4409: permissible systematic errors of instruments.

/// Measurement class of ISO 4409.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SensorClass {
    /// Class A: speed and flow 0.5 %, pressure 0.5 %, temperature 0.5 K.
    A,
    /// Class B: speed 1 %, flow 1.5 %, pressure 1.5 %, temperature 1 K.
    B,
    /// Class C: speed 2 %, flow 2.5 %, pressure 2.5 %, temperature 2 K.
    C,
}

impl SensorClass {
    /// Permissible systematic errors: speed, flow and pressure relative, temperature in K.
    #[must_use]
    pub const fn permissible(self) -> [f64; 4] {
        match self {
            Self::A => [0.005, 0.005, 0.005, 0.5],
            Self::B => [0.01, 0.015, 0.015, 1.0],
            Self::C => [0.02, 0.025, 0.025, 2.0],
        }
    }
}
