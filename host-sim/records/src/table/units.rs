//! The quantities that a table may hold, the units in which a file may state them, and what values make sense.

use crate::Range;

/// A quantity of logs and bench tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Quantity {
    /// Time since the record's beginning.
    Time,
    /// Pump speed.
    PumpSpeed,
    /// Motor speed.
    MotorSpeed,
    /// High pressure, gauge.
    HighPressure,
    /// Temperature of the compensated oil.
    OilTemperature,
    /// Low pressure, gauge.
    LowPressure,
    /// Displacement fraction of the pump.
    Displacement,
    /// Flow into the high line.
    Flow,
    /// Speed ratio.
    Ratio,
}

/// What a file's number means: value in our unit = number * scale + offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conversion {
    /// Factor.
    pub scale: f64,
    /// Addend, in our unit.
    pub offset: f64,
}

impl Conversion {
    /// The number is in our unit already.
    pub const NONE: Self = Self { scale: 1.0, offset: 0.0 };

    /// Applies the conversion.
    #[must_use]
    pub fn apply(self, number: f64) -> f64 {
        number * self.scale + self.offset
    }
}

/// Unit names with their conversions.
type Units = &'static [(&'static str, f64, f64)];

const TIME: Units =
    &[("s", 1.0, 0.0), ("ms", 1e-3, 0.0), ("us", 1e-6, 0.0), ("min", 60.0, 0.0), ("h", 3600.0, 0.0)];
const SPEED: Units = &[
    ("r/min", 1.0, 0.0),
    ("rpm", 1.0, 0.0),
    ("1/min", 1.0, 0.0),
    ("r/s", 60.0, 0.0),
    ("rad/s", 60.0 / std::f64::consts::TAU, 0.0),
];
/// Gauge pressures, and absolute ones over a standard atmosphere.
const PRESSURE: Units = &[
    ("MPa", 1.0, 0.0),
    ("bar", 0.1, 0.0),
    ("kPa", 1e-3, 0.0),
    ("Pa", 1e-6, 0.0),
    ("psi", 6.894_757_293_168e-3, 0.0),
    ("MPa abs", 1.0, -0.101_325),
    ("bar abs", 0.1, -0.101_325),
];
const TEMPERATURE: Units =
    &[("C", 1.0, 0.0), ("degC", 1.0, 0.0), ("K", 1.0, -273.15), ("F", 5.0 / 9.0, -160.0 / 9.0)];
const FLOW: Units = &[
    ("L/min", 1.0, 0.0),
    ("l/min", 1.0, 0.0),
    ("m3/h", 1000.0 / 60.0, 0.0),
    ("m3/s", 60_000.0, 0.0),
    ("cm3/s", 0.06, 0.0),
    ("gal/min", 3.785_411_784, 0.0),
];
const FRACTION: Units = &[("1", 1.0, 0.0), ("%", 0.01, 0.0)];

impl Quantity {
    /// Every quantity.
    pub const ALL: [Self; 9] = [
        Self::Time,
        Self::PumpSpeed,
        Self::MotorSpeed,
        Self::HighPressure,
        Self::OilTemperature,
        Self::LowPressure,
        Self::Displacement,
        Self::Flow,
        Self::Ratio,
    ];

    /// Our own column's name, with the unit in it.
    #[must_use]
    pub const fn column(self) -> &'static str {
        match self {
            Self::Time => "time_s",
            Self::PumpSpeed => "n_p_rpm",
            Self::MotorSpeed => "n_m_rpm",
            Self::HighPressure => "p_h_mpa",
            Self::OilTemperature => "t_b_c",
            Self::LowPressure => "p_l_mpa",
            Self::Displacement => "alpha",
            Self::Flow => "flow_l_min",
            Self::Ratio => "ratio",
        }
    }

    /// The quantity with this column name.
    #[must_use]
    pub fn from_column(column: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|q| q.column() == column)
    }

    /// Values that a bench point may have. Wide for machines, narrow enough to catch a slip of unit.
    #[must_use]
    pub const fn bench_range(self) -> Range {
        match self {
            Self::Time => Range::new(0.0, 1e12, "s"),
            Self::PumpSpeed => Range::new(1.0, 20_000.0, "r/min"),
            Self::MotorSpeed => Range::new(-20_000.0, 20_000.0, "r/min"),
            Self::HighPressure => Range::new(0.5, 100.0, "MPa"),
            Self::OilTemperature => Range::new(-40.0, 150.0, "degC"),
            Self::LowPressure => Range::new(-0.06, 10.0, "MPa"),
            Self::Displacement => Range::new(-1.0, 1.0, ""),
            Self::Flow => Range::new(0.0, 50_000.0, "L/min"),
            Self::Ratio => Range::new(-1.2, 1.2, ""),
        }
    }

    /// Conversion from a unit's name, or the list of names that are known.
    ///
    /// # Errors
    /// The known units of this quantity, for the message.
    pub fn conversion(self, unit: &str) -> Result<Conversion, String> {
        let units = match self {
            Self::Time => TIME,
            Self::PumpSpeed | Self::MotorSpeed => SPEED,
            Self::HighPressure | Self::LowPressure => PRESSURE,
            Self::OilTemperature => TEMPERATURE,
            Self::Flow => FLOW,
            Self::Displacement | Self::Ratio => FRACTION,
        };
        units
            .iter()
            .find(|(name, ..)| *name == unit)
            .map(|&(_, scale, offset)| Conversion { scale, offset })
            .ok_or_else(|| units.iter().map(|(name, ..)| *name).collect::<Vec<_>>().join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_convert_as_tabulated_by_nist() {
        let cases = [
            (Quantity::HighPressure, "bar", 310.6, 31.06),
            (Quantity::HighPressure, "psi", 5000.0, 34.473_786),
            (Quantity::HighPressure, "bar abs", 11.013_25, 1.0),
            (Quantity::OilTemperature, "K", 331.39, 58.24),
            (Quantity::OilTemperature, "F", 212.0, 100.0),
            (Quantity::PumpSpeed, "rad/s", 104.719_755, 1000.0),
            (Quantity::Flow, "gal/min", 1.0, 3.785_411_784),
            (Quantity::Displacement, "%", 30.0, 0.3),
        ];
        for (quantity, unit, number, wanted) in cases {
            let got = quantity.conversion(unit).unwrap().apply(number);
            assert!((got - wanted).abs() < 1e-6 * wanted.abs(), "{unit}: {got}");
        }
        assert!(Quantity::HighPressure.conversion("K").unwrap_err().contains("psi"));
    }
}
