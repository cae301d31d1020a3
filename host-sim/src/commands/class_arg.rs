//! Command-line form of the measurement classes of ISO 4409.

use kou_identify::SensorClass;

/// Measurement class of ISO 4409 (permissible systematic errors of instruments).
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum ClassArg {
    /// Class A: speed and flow 0.5 %, pressure 0.5 %, temperature 0.5 K.
    #[value(name = "A")]
    A,
    /// Class B: speed 1 %, flow 1.5 %, pressure 1.5 %, temperature 1 K.
    #[value(name = "B")]
    B,
    /// Class C: speed 2 %, flow 2.5 %, pressure 2.5 %, temperature 2 K.
    #[value(name = "C")]
    C,
}

impl From<ClassArg> for SensorClass {
    fn from(class: ClassArg) -> Self {
        match class {
            ClassArg::A => Self::A,
            ClassArg::B => Self::B,
            ClassArg::C => Self::C,
        }
    }
}
