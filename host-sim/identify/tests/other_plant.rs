//! Identification of a plant model from outside the crate: a closure behind the trait [`PlantModel`], without a machine file.

use kou_identify::calibration::CalibrationSettings;
use kou_identify::joint::Prior;
use kou_identify::secant::SecantSettings;
use kou_identify::{
    HydraulicUnit, Identification, MachineCorrection, MachineParameters, OilCompressibility, OperatingPoint,
    PlantError, PlantModel, RatioReference, SensorClass, SteadyResponse, joint_scheme, two_step,
};
use kou_records::{BenchPoint, InputError};

const DISPLACEMENT_CM3: f64 = 210.0;
const BULK_MODULUS_MPA: f64 = 1600.0;

/// Plant model that calls a function with operating point, leakage coefficient and correction.
struct ClosurePlant<'a> {
    ratio: &'a (dyn Fn(&OperatingPoint, f64, MachineCorrection) -> f64 + Sync),
    correction: MachineCorrection,
}

impl PlantModel for ClosurePlant<'_> {
    fn solve(&self, at: &OperatingPoint, kou: f64) -> Result<SteadyResponse, PlantError> {
        let ratio = (self.ratio)(at, kou, self.correction);
        if ratio > 0.0 {
            Ok(SteadyResponse { ratio, p_l_mpa: 1.5 })
        } else {
            Err(PlantError::Unreachable("the leakage exceeds the flow of the pump".into()))
        }
    }

    fn corrected(&self, correction: MachineCorrection) -> Result<Box<dyn PlantModel + '_>, InputError> {
        Ok(Box::new(ClosurePlant { correction, ..*self }))
    }
}

/// Volumetric balance: pump flow minus compression of dead volume and swept volume minus leakage of nine chambers.
fn volumetric(at: &OperatingPoint, kou: f64, correction: MachineCorrection) -> f64 {
    let volume = 0.9 + 0.5 * (1.0 + at.alpha);
    let compression = volume * at.p_h_mpa / (correction.bulk * BULK_MODULUS_MPA);
    let leakage = 9.0 * kou * at.p_h_mpa / (at.n_p_rpm * DISPLACEMENT_CM3 / 1000.0);
    correction.displacement * (at.alpha - compression) - leakage
}

fn machine() -> MachineParameters {
    let unit =
        HydraulicUnit { pistons: 9, displacement_cm3_per_rev: DISPLACEMENT_CM3, dead_volume_cm3: 12.0 };
    MachineParameters {
        name: "volumetric".into(),
        pump: unit,
        reference: RatioReference::Motor(unit),
        oil: OilCompressibility {
            bulk_modulus_mpa: BULK_MODULUS_MPA,
            air_fraction: 0.005,
            heat_capacity_ratio: 1.4,
            bulk_modulus_per_k: -0.003,
            reference_c: 40.0,
        },
        low_pressure_mpa: 1.5,
        case_pressure_mpa: 0.2,
    }
}

fn truth(n_p_rpm: f64, p_h_mpa: f64, t_b_c: f64) -> f64 {
    0.03 + 0.01 * n_p_rpm / 2800.0 + 0.015 * (p_h_mpa / 50.0).powi(2) + 0.02 * t_b_c / 90.0
}

/// Bench of the machine with this correction.
fn bench(correction: MachineCorrection) -> Vec<BenchPoint> {
    let mut points = Vec::new();
    for t_b_c in [30.0, 60.0, 90.0] {
        for n_p_rpm in [1000.0, 2000.0, 2800.0] {
            for p_h_mpa in [10.0, 20.0, 30.0, 40.0, 50.0] {
                let at = OperatingPoint { n_p_rpm, p_h_mpa, p_l_mpa: None, t_b_c, alpha: 1.0 };
                let ratio = volumetric(&at, truth(n_p_rpm, p_h_mpa, t_b_c), correction);
                let line = points.len() as u64 + 2;
                points.push(BenchPoint { line, n_p_rpm, p_h_mpa, p_l_mpa: None, t_b_c, alpha: 1.0, ratio });
            }
        }
    }
    points
}

fn settings() -> CalibrationSettings {
    CalibrationSettings {
        serial: String::new(),
        date: String::new(),
        class: SensorClass::A,
        bench_crc32: 0,
        machine_crc32: 0,
    }
}

fn mean_kou_error(result: &Identification) -> f64 {
    let errors = result.points.iter().map(|p| {
        let exact = truth(p.point.n_p_rpm, p.point.p_h_mpa, p.point.t_b_c);
        (p.kou_law / exact - 1.0).abs()
    });
    errors.sum::<f64>() / result.points.len() as f64
}

#[test]
fn both_schemes_identify_a_closure_as_plant_model() {
    let plant = ClosurePlant { ratio: &volumetric, correction: MachineCorrection::NONE };
    let points = bench(MachineCorrection::NONE);
    let steps = two_step::identify(machine(), &points, &settings(), Some(&plant), &SecantSettings::default())
        .unwrap();
    let joint =
        joint_scheme::identify(machine(), &points, &settings(), Some(&plant), &Prior::default()).unwrap();
    println!("Kou: two steps {:.1e}, joint {:.1e}", mean_kou_error(&steps), mean_kou_error(&joint));
    // The secant's tolerance of 1e-4 of the ratio is up to 2 % of Kou.
    assert_eq!((steps.points.len(), joint.points.len()), (45, 45));
    assert!(mean_kou_error(&steps) < 0.02 && mean_kou_error(&joint) < 0.02);
}

#[test]
fn joint_scheme_corrects_the_displacement_of_a_closure_as_plant_model() {
    let plant = ClosurePlant { ratio: &volumetric, correction: MachineCorrection::NONE };
    let points = bench(MachineCorrection { displacement: 1.01, bulk: 1.0 });
    let result =
        joint_scheme::identify(machine(), &points, &settings(), Some(&plant), &Prior::default()).unwrap();
    println!("displacement {:.5}, Kou {:.1e}", result.correction.displacement, mean_kou_error(&result));
    assert!((result.correction.displacement - 1.01).abs() < 1e-3);
    assert!(mean_kou_error(&result) < 0.03);
}
