//! Butcher tableaux of the ESDIRK methods: explicit first stage, constant diagonal, stiffly accurate, L-stable.

/// Largest number of stages.
pub const MAX_STAGES: usize = 4;

/// Coefficients of one method. Stage i solves m_i = m_0 + h*(sum over j below i of a_ij k_j + gamma k_i); the last
/// stage is the new state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ButcherTableau {
    /// Number of stages, the explicit first one included.
    pub stages: usize,
    /// Diagonal coefficient.
    pub gamma: f64,
    /// Coefficients below the diagonal.
    pub a: [[f64; MAX_STAGES]; MAX_STAGES],
    /// Abscissae of the stages.
    pub c: [f64; MAX_STAGES],
}

/// Implicit Runge-Kutta method.
#[doc(alias = "ESDIRK")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// TR-BDF2 (Bank et al. 1985, as ESDIRK by Hosea and Shampine 1996): order 2, two implicit stages.
    TrBdf2,
    /// ESDIRK3(2)4L\[2\]SA (Kennedy and Carpenter 2016): order 3, three implicit stages.
    #[default]
    Esdirk3,
}

impl Method {
    /// The method's coefficients.
    #[must_use]
    pub fn tableau(self) -> ButcherTableau {
        match self {
            Method::TrBdf2 => {
                let gamma = 1.0 - std::f64::consts::FRAC_1_SQRT_2;
                let w = std::f64::consts::SQRT_2 / 4.0;
                ButcherTableau {
                    stages: 3,
                    gamma,
                    a: [[0.0; 4], [gamma, 0.0, 0.0, 0.0], [w, w, 0.0, 0.0], [0.0; 4]],
                    c: [0.0, 2.0 * gamma, 1.0, 0.0],
                }
            }
            Method::Esdirk3 => {
                // Root of g^3 - 3 g^2 + 3/2 g - 1/6 = 0 that makes the method L-stable.
                let gamma = 0.435_866_521_508_459;
                let (c2, c3) = (2.0 * gamma, 0.6);
                // Stage order 2: sum_j a_ij c_j = c_i^2/2, and sum_j a_ij = c_i.
                let a32 = (0.5 * c3 * c3 - gamma * c3) / c2;
                let a31 = c3 - gamma - a32;
                // Order 3: sum b c = 1/2 and sum b c^2 = 1/3 with b4 = gamma at c4 = 1.
                let (r1, r2) = (0.5 - gamma, 1.0 / 3.0 - gamma);
                let b2 = (r1 * c3 - r2) / (c2 * (c3 - c2));
                let b3 = (r2 - r1 * c2) / (c3 * (c3 - c2));
                let b1 = 1.0 - gamma - b2 - b3;
                ButcherTableau {
                    stages: 4,
                    gamma,
                    a: [[0.0; 4], [gamma, 0.0, 0.0, 0.0], [a31, a32, 0.0, 0.0], [b1, b2, b3, 0.0]],
                    c: [0.0, c2, c3, 1.0],
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prop_tableaux_meet_their_order_conditions() {
        for (method, order) in [(Method::TrBdf2, 2), (Method::Esdirk3, 3)] {
            let t = method.tableau();
            let last = t.stages - 1;
            let mut b = t.a[last];
            b[last] = t.gamma;
            let sum = |f: &dyn Fn(usize) -> f64| (0..t.stages).map(|i| b[i] * f(i)).sum::<f64>();
            // Rounding of a few coefficients only.
            assert!((sum(&|_| 1.0) - 1.0).abs() < 1e-14);
            assert!((sum(&|i| t.c[i]) - 0.5).abs() < 1e-14);
            if order > 2 {
                assert!((sum(&|i| t.c[i] * t.c[i]) - 1.0 / 3.0).abs() < 1e-14);
                let row = |i: usize| (0..i).map(|j| t.a[i][j] * t.c[j]).sum::<f64>() + t.gamma * t.c[i];
                assert!((sum(&|i| if i == 0 { 0.0 } else { row(i) }) - 1.0 / 6.0).abs() < 1e-14);
            }
        }
    }
}
