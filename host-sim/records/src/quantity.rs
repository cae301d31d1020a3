//! Measured quantities of tables and logs: column names, accepted units with their conversions, and valid ranges.

use crate::input_error::AllowedRange;

/// Measured quantity of a log or bench table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum MeasuredQuantity {
    /// Time since the start of the record.
    Time,
    /// Pump speed.
    PumpSpeed,
    /// Motor speed.
    MotorSpeed,
    /// High pressure, gauge.
    HighPressure,
    /// Oil temperature.
    OilTemperature,
    /// Low pressure, gauge.
    LowPressure,
    /// Displacement fraction of the pump, -1 to 1.
    Displacement,
    /// Flow into the high-pressure line.
    Flow,
    /// Speed ratio, motor to pump.
    Ratio,
}

/// Linear unit conversion: value = number * scale + offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnitConversion {
    /// Factor on the file's number.
    pub scale: f64,
    /// Offset, in the internal unit.
    pub offset: f64,
}

impl UnitConversion {
    /// Identity: the number is in the internal unit already.
    pub const NONE: Self = Self { scale: 1.0, offset: 0.0 };

    /// Value in the internal unit.
    #[must_use]
    pub fn apply(self, number: f64) -> f64 {
        number * self.scale + self.offset
    }
}

/// Unit names with scale and offset.
type UnitTable = &'static [(&'static str, f64, f64)];

const TIME: UnitTable =
    &[("s", 1.0, 0.0), ("ms", 1e-3, 0.0), ("us", 1e-6, 0.0), ("min", 60.0, 0.0), ("h", 3600.0, 0.0)];
const SPEED: UnitTable = &[
    ("r/min", 1.0, 0.0),
    ("rpm", 1.0, 0.0),
    ("1/min", 1.0, 0.0),
    ("r/s", 60.0, 0.0),
    ("rad/s", 60.0 / std::f64::consts::TAU, 0.0),
];
/// Gauge pressures; absolute ones are relative to the standard atmosphere, 0.101325 MPa.
const PRESSURE: UnitTable = &[
    ("MPa", 1.0, 0.0),
    ("bar", 0.1, 0.0),
    ("kPa", 1e-3, 0.0),
    ("Pa", 1e-6, 0.0),
    ("psi", 6.894_757_293_168e-3, 0.0),
    ("MPa abs", 1.0, -0.101_325),
    ("bar abs", 0.1, -0.101_325),
];
const TEMPERATURE: UnitTable =
    &[("C", 1.0, 0.0), ("degC", 1.0, 0.0), ("K", 1.0, -273.15), ("F", 5.0 / 9.0, -160.0 / 9.0)];
const FLOW: UnitTable = &[
    ("L/min", 1.0, 0.0),
    ("l/min", 1.0, 0.0),
    ("m3/h", 1000.0 / 60.0, 0.0),
    ("m3/s", 60_000.0, 0.0),
    ("cm3/s", 0.06, 0.0),
    ("gal/min", 3.785_411_784, 0.0),
];
const FRACTION: UnitTable = &[("1", 1.0, 0.0), ("%", 0.01, 0.0)];

impl MeasuredQuantity {
    /// All quantities.
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

    /// Default column name, which contains the internal unit.
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

    /// Quantity with this default column name.
    #[must_use]
    pub fn from_column(column: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|q| q.column() == column)
    }

    /// Valid range of a bench point: wide enough for every machine, narrow enough to detect a wrong unit.
    #[must_use]
    pub const fn bench_range(self) -> AllowedRange {
        match self {
            Self::Time => AllowedRange::new(0.0, 1e12, "s"),
            Self::PumpSpeed => AllowedRange::new(1.0, 20_000.0, "r/min"),
            Self::MotorSpeed => AllowedRange::new(-20_000.0, 20_000.0, "r/min"),
            Self::HighPressure => AllowedRange::new(0.5, 100.0, "MPa"),
            Self::OilTemperature => AllowedRange::new(-40.0, 150.0, "degC"),
            Self::LowPressure => AllowedRange::new(-0.06, 10.0, "MPa"),
            Self::Displacement => AllowedRange::new(-1.0, 1.0, ""),
            Self::Flow => AllowedRange::new(0.0, 50_000.0, "L/min"),
            Self::Ratio => AllowedRange::new(-1.2, 1.2, ""),
        }
    }

    /// Conversion from the named unit.
    ///
    /// # Errors
    /// The accepted unit names of this quantity, when `unit` is not among them.
    pub fn conversion(self, unit: &str) -> Result<UnitConversion, String> {
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
            .map(|&(_, scale, offset)| UnitConversion { scale, offset })
            .ok_or_else(|| units.iter().map(|(name, ..)| *name).collect::<Vec<_>>().join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_convert_as_tabulated_by_nist() {
        let cases = [
            (MeasuredQuantity::HighPressure, "bar", 310.6, 31.06),
            (MeasuredQuantity::HighPressure, "psi", 5000.0, 34.473_786),
            (MeasuredQuantity::HighPressure, "bar abs", 11.013_25, 1.0),
            (MeasuredQuantity::OilTemperature, "K", 331.39, 58.24),
            (MeasuredQuantity::OilTemperature, "F", 212.0, 100.0),
            (MeasuredQuantity::PumpSpeed, "rad/s", 104.719_755, 1000.0),
            (MeasuredQuantity::Flow, "gal/min", 1.0, 3.785_411_784),
            (MeasuredQuantity::Displacement, "%", 30.0, 0.3),
        ];
        for (quantity, unit, number, wanted) in cases {
            let got = quantity.conversion(unit).unwrap().apply(number);
            assert!((got - wanted).abs() < 1e-6 * wanted.abs(), "{unit}: {got}");
        }
        assert!(MeasuredQuantity::HighPressure.conversion("K").unwrap_err().contains("psi"));
    }
}
