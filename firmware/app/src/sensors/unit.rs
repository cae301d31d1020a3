//! The unit types that a channel can give.

use kou_estimator::units::{Celsius, Megapascal, Ratio};

/// A unit type over `f32`; implemented for the units of analogue channels, and only here.
pub trait SensorUnit: Copy + PartialEq + private::Sealed {
    /// From the bare number in this unit.
    fn from_bare(value: f32) -> Self;
    /// The bare number in this unit.
    fn bare(self) -> f32;
}

mod private {
    pub trait Sealed {}
}

macro_rules! quantity {
    ($($unit:ident),*) => {$(
        impl private::Sealed for $unit {}
        impl SensorUnit for $unit {
            fn from_bare(value: f32) -> Self {
                Self(value)
            }
            fn bare(self) -> f32 {
                self.get()
            }
        }
    )*};
}

quantity!(Megapascal, Celsius, Ratio);
