//! Unit types of the public interface.
//!
//! Every quantity crosses the estimator's interface in a type that names its unit; numerical kernels use bare `f32`
//! with a unit suffix. Displacement per revolution and per radian are different types, so that one cannot be passed for
//! the other. Pressures are gauge; [`MegapascalAbs`] is for the equation of state only.

use serde::{Deserialize, Serialize};

macro_rules! unit {
    ($(#[$doc:meta])* $name:ident, $symbol:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[serde(transparent)]
        #[repr(transparent)]
        pub struct $name(pub f32);

        impl $name {
            /// Symbol of the unit.
            pub const SYMBOL: &'static str = $symbol;

            /// Numerical value in this unit.
            #[inline(always)]
            #[must_use]
            pub const fn get(self) -> f32 {
                self.0
            }
        }

        impl From<$name> for f32 {
            #[inline(always)]
            fn from(value: $name) -> Self {
                value.0
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                core::fmt::Display::fmt(&self.0, f)?;
                f.write_str(concat!(" ", $symbol))
            }
        }
    };
}

unit!(
    /// Shaft speed in r/min. Positive in the direction in which positive displacement drives the motor.
    RevPerMin, "r/min"
);
unit!(
    /// Gauge pressure in MPa: zero is the atmosphere.
    Megapascal, "MPa"
);
unit!(
    /// Absolute pressure in MPa; used by the oil's equation of state only.
    MegapascalAbs, "MPa abs"
);
unit!(
    /// Temperature in degrees Celsius.
    Celsius, "degC"
);
unit!(
    /// Volume flow in L/min, at the pressure of the line in which it is stated.
    LitrePerMin, "L/min"
);
unit!(
    /// Volume in cubic centimetres.
    CubicCentimetre, "cm3"
);
unit!(
    /// Displacement per REVOLUTION of the shaft in cm3/rev.
    CubicCentimetrePerRev, "cm3/rev"
);
unit!(
    /// Displacement per RADIAN of the shaft in cm3/rad; torque is displacement per radian times pressure.
    CubicCentimetrePerRad, "cm3/rad"
);
unit!(
    /// External leakage coefficient `Kou` of ONE piston chamber, in (L/min)/MPa.
    LeakageCoefficient, "(L/min)/MPa"
);
unit!(
    /// Pure number: speed ratio, efficiency, displacement fraction.
    Ratio, "1"
);

/// Standard atmosphere, `p_0` of the Wylie model and the offset between gauge and absolute pressure, in MPa.
pub const STANDARD_ATMOSPHERE_MPA: f32 = 0.101_325;

impl Megapascal {
    /// The same pressure on the absolute scale, over a standard atmosphere.
    #[inline(always)]
    #[must_use]
    pub fn to_absolute(self) -> MegapascalAbs {
        MegapascalAbs(self.0 + STANDARD_ATMOSPHERE_MPA)
    }
}

impl MegapascalAbs {
    /// The same pressure on the gauge scale, over a standard atmosphere.
    #[must_use]
    pub fn to_gauge(self) -> Megapascal {
        Megapascal(self.0 - STANDARD_ATMOSPHERE_MPA)
    }
}

impl CubicCentimetrePerRev {
    /// The same displacement per radian: divided by 2 pi.
    #[must_use]
    pub fn per_radian(self) -> CubicCentimetrePerRad {
        CubicCentimetrePerRad(self.0 / core::f32::consts::TAU)
    }
}

impl CubicCentimetrePerRad {
    /// The same displacement per revolution: times 2 pi.
    #[must_use]
    pub fn per_revolution(self) -> CubicCentimetrePerRev {
        CubicCentimetrePerRev(self.0 * core::f32::consts::TAU)
    }
}

/// Time stamp in microseconds since an epoch of the recorder's choice; only differences are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[serde(transparent)]
pub struct Micros(pub u64);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn displacement_per_radian_gives_the_torque_of_the_reference_load() {
        // The paper's load: 300 cm3/rev at 35.0 MPa is 1671 N m (cm3 * MPa = N m).
        let torque_nm = CubicCentimetrePerRev(300.0).per_radian().get() * 35.0;
        assert!((torque_nm - 1671.1).abs() < 0.1, "{torque_nm}");
    }

    #[test]
    fn gauge_and_absolute_differ_by_one_atmosphere() {
        let absolute = Megapascal(1.5).to_absolute();
        assert!((absolute.get() - 1.601_325).abs() < 1e-6);
        assert!((absolute.to_gauge().get() - 1.5).abs() < 1e-6);
    }
}
