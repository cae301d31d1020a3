//! Vectors of four `f64` lanes, which the compiler turns into SIMD instructions.
//!
//! Plain arrays and loops of fixed length: the same bits on every processor, no unsafe code. The instruction set is
//! selected at run time where a batch of steps is dispatched ([`crate::stepping`]).

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Lanes of a vector.
pub const WIDTH: usize = 4;

/// Vector of four `f64`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(align(32))]
pub struct F64x4(pub [f64; WIDTH]);

macro_rules! operator {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for F64x4 {
            type Output = F64x4;
            #[inline(always)]
            fn $method(self, other: F64x4) -> F64x4 {
                let mut r = self.0;
                for l in 0..WIDTH {
                    r[l] = self.0[l] $op other.0[l];
                }
                F64x4(r)
            }
        }
    };
}
operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);
operator!(Div, div, /);

impl Neg for F64x4 {
    type Output = F64x4;
    #[inline(always)]
    fn neg(self) -> F64x4 {
        F64x4::ZERO - self
    }
}

impl AddAssign for F64x4 {
    #[inline(always)]
    fn add_assign(&mut self, other: F64x4) {
        *self = *self + other;
    }
}

impl F64x4 {
    /// All lanes zero.
    pub const ZERO: F64x4 = F64x4([0.0; WIDTH]);

    /// All lanes equal.
    #[inline(always)]
    #[must_use]
    pub const fn all(x: f64) -> F64x4 {
        F64x4([x; WIDTH])
    }

    /// Square root of each lane.
    #[inline(always)]
    #[must_use]
    pub fn sqrt(self) -> F64x4 {
        let mut r = self.0;
        for x in &mut r {
            *x = x.sqrt();
        }
        F64x4(r)
    }

    /// Absolute value of each lane.
    #[inline(always)]
    #[must_use]
    pub fn abs(self) -> F64x4 {
        let mut r = self.0;
        for x in &mut r {
            *x = x.abs();
        }
        F64x4(r)
    }

    /// Select: `yes` where `self > other`, else `no` (also where either is NaN).
    #[inline(always)]
    #[must_use]
    pub fn if_above(self, other: F64x4, yes: F64x4, no: F64x4) -> F64x4 {
        let mut r = no.0;
        for (l, x) in r.iter_mut().enumerate() {
            *x = if self.0[l] > other.0[l] { yes.0[l] } else { no.0[l] };
        }
        F64x4(r)
    }

    /// The larger of each lane.
    #[inline(always)]
    #[must_use]
    pub fn max(self, other: F64x4) -> F64x4 {
        self.if_above(other, self, other)
    }

    /// The smaller of each lane.
    #[inline(always)]
    #[must_use]
    pub fn min(self, other: F64x4) -> F64x4 {
        self.if_above(other, other, self)
    }

    /// Sum of the lanes.
    #[inline(always)]
    #[must_use]
    pub fn sum(self) -> f64 {
        (self.0[0] + self.0[1]) + (self.0[2] + self.0[3])
    }

    /// Smallest lane.
    #[inline(always)]
    #[must_use]
    pub fn smallest(self) -> f64 {
        self.0[0].min(self.0[1]).min(self.0[2].min(self.0[3]))
    }

    /// Largest lane.
    #[inline(always)]
    #[must_use]
    pub fn largest(self) -> f64 {
        self.0[0].max(self.0[1]).max(self.0[2].max(self.0[3]))
    }
}
