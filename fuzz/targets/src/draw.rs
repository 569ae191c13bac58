//! Numbers from bytes: mostly such as occur, sometimes extreme ones, now and then any bits at all.

use arbitrary::Unstructured;
use glam::{DQuat, DVec3};

/// Bytes that are used up; behind their end come zeros.
pub struct Draw<'a> {
    bytes: Unstructured<'a>,
    /// No number beyond the range asked for.
    pub tame: bool,
}

impl<'a> Draw<'a> {
    pub fn new(data: &'a [u8]) -> Draw<'a> {
        Draw {
            bytes: Unstructured::new(data),
            tame: false,
        }
    }

    fn get<T: arbitrary::Arbitrary<'a> + Default>(&mut self) -> T {
        self.bytes.arbitrary().unwrap_or_default()
    }

    pub fn byte(&mut self) -> u8 {
        self.get()
    }

    /// One of `0..n`.
    pub fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n
    }

    pub fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())]
    }

    /// True once in `n`; never once the bytes are used up.
    pub fn rarely(&mut self, n: usize) -> bool {
        self.below(n) == n - 1
    }

    /// In `[low, high]`.
    pub fn real(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * f64::from(self.get::<u16>()) / f64::from(u16::MAX)
    }

    /// Of any size, sign or kind.
    pub fn any(&mut self) -> f64 {
        match self.below(4) {
            0 => f64::from_bits(self.get()),
            1 => self.one_of(&[
                0.0,
                -0.0,
                1.0,
                -1.0,
                f64::NAN,
                f64::INFINITY,
                f64::MAX,
                5e-324,
            ]),
            _ => {
                let digits = f64::from(self.get::<i16>()) / 4096.0;
                digits * 10f64.powi(i32::from(self.get::<i8>()) * 5 / 2)
            }
        }
    }

    /// In `[low, high]`, 1 of 32 times whatever.
    pub fn number(&mut self, low: f64, high: f64) -> f64 {
        if self.rarely(32) && !self.tame {
            self.any()
        } else {
            self.real(low, high)
        }
    }

    /// `centre` times a power of ten of at most `decades` up or down; 1 of 32 times whatever.
    pub fn size(&mut self, centre: f64, decades: f64) -> f64 {
        if self.rarely(32) && !self.tame {
            return self.any();
        }
        centre * 10f64.powf(self.real(-decades, decades))
    }

    pub fn vector(&mut self, size: f64) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| self.number(-size, size)))
    }

    /// Mostly an axis or a diagonal: contacts in line and redundant ones come from these.
    pub fn direction(&mut self) -> DVec3 {
        let v = match self.below(4) {
            0 => DVec3::Z,
            1 => DVec3::AXES[self.below(3)] * self.one_of(&[1.0, -1.0]),
            2 => DVec3::from_array(std::array::from_fn(|_| self.one_of(&[0.0, 1.0, -1.0]))),
            _ => DVec3::from_array(std::array::from_fn(|_| self.real(-1.0, 1.0))),
        };
        v.try_normalize().unwrap_or(DVec3::X)
    }

    pub fn turn(&mut self) -> DQuat {
        DQuat::from_scaled_axis(3.0 * self.direction() * self.real(0.0, 1.0))
    }
}
