//! Units of analogue channels.

use kou_estimator::units::{Celsius, Megapascal, Ratio};

/// Unit type over `f32`; sealed, implemented for the units of analogue channels.
pub trait SensorUnit: Copy + PartialEq + private::Sealed {
    /// Quantity from its value in this unit.
    fn from_bare(value: f32) -> Self;
    /// Value in this unit.
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
