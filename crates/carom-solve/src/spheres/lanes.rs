//! Instruction sets: what `pulp` leaves open for the kernel, rows of bodies to columns of lanes and back.

use glam::DVec3;
use pulp::Simd;

/// Contacts of a group; a multiple of the lanes of every instruction set.
pub const GROUP: usize = 8;
/// Bit of an id: the sides of this contact are exchanged.
pub const SWAPPED: u32 = 1 << 31;
/// Id of a lane without contact.
pub const EMPTY: u32 = u32::MAX;

/// A number of each contact of a group.
pub type Column = [f64; GROUP];

/// The vector of one lane.
pub fn vector(columns: &[Column; 3], lane: usize) -> DVec3 {
    DVec3::new(columns[0][lane], columns[1][lane], columns[2][lane])
}

/// Without the inverse mass.
pub fn head(row: &[f64; 4]) -> DVec3 {
    DVec3::new(row[0], row[1], row[2])
}

/// An instruction set that treats `F64_LANES` contacts at a time, and the four numbers of a row of a body at a time.
pub trait Lanes: Simd {
    type Row: Copy;
    fn row(self, numbers: &[f64; 4]) -> Self::Row;
    fn numbers(self, row: Self::Row) -> [f64; 4];
    fn row_add(self, x: Self::Row, y: Self::Row) -> Self::Row;
    fn row_sub(self, x: Self::Row, y: Self::Row) -> Self::Row;
    fn row_scale(self, factor: f64, x: Self::Row) -> Self::Row;

    /// Row `l` of `F64_LANES` rows becomes lane `l` of the columns x, y, z; the fourth number is dropped.
    fn columns(self, row: impl Fn(usize) -> Self::Row) -> [Self::f64s; 3];

    /// The inverse of [`Lanes::columns`] with 0 as the fourth number, for two sets of columns: hands rows `l` to
    /// `take(l, row of x, row of y)`, in order.
    fn rows(
        self,
        x: [Self::f64s; 3],
        y: [Self::f64s; 3],
        take: impl FnMut(usize, Self::Row, Self::Row),
    );
}

/// Rows as plain arrays.
macro_rules! plain_rows {
    () => {
        type Row = [f64; 4];
        #[inline(always)]
        fn row(self, numbers: &[f64; 4]) -> [f64; 4] {
            *numbers
        }
        #[inline(always)]
        fn numbers(self, row: [f64; 4]) -> [f64; 4] {
            row
        }
        #[inline(always)]
        fn row_add(self, x: [f64; 4], y: [f64; 4]) -> [f64; 4] {
            [x[0] + y[0], x[1] + y[1], x[2] + y[2], x[3] + y[3]]
        }
        #[inline(always)]
        fn row_sub(self, x: [f64; 4], y: [f64; 4]) -> [f64; 4] {
            [x[0] - y[0], x[1] - y[1], x[2] - y[2], x[3] - y[3]]
        }
        #[inline(always)]
        fn row_scale(self, factor: f64, x: [f64; 4]) -> [f64; 4] {
            [factor * x[0], factor * x[1], factor * x[2], factor * x[3]]
        }
    };
}

impl Lanes for pulp::Scalar {
    plain_rows!();

    #[inline(always)]
    fn columns(self, row: impl Fn(usize) -> [f64; 4]) -> [f64; 3] {
        let [x, y, z, _] = row(0);
        [x, y, z]
    }

    #[inline(always)]
    fn rows(self, x: [f64; 3], y: [f64; 3], mut take: impl FnMut(usize, [f64; 4], [f64; 4])) {
        take(0, [x[0], x[1], x[2], 0.0], [y[0], y[1], y[2], 0.0]);
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for pulp::x86::V3 {
    type Row = pulp::f64x4;

    #[inline(always)]
    fn row(self, numbers: &[f64; 4]) -> Self::Row {
        pulp::cast(*numbers)
    }

    #[inline(always)]
    fn numbers(self, row: Self::Row) -> [f64; 4] {
        pulp::cast(row)
    }

    #[inline(always)]
    fn row_add(self, x: Self::Row, y: Self::Row) -> Self::Row {
        self.add_f64s(x, y)
    }

    #[inline(always)]
    fn row_sub(self, x: Self::Row, y: Self::Row) -> Self::Row {
        self.sub_f64s(x, y)
    }

    #[inline(always)]
    fn row_scale(self, factor: f64, x: Self::Row) -> Self::Row {
        self.mul_f64s(self.splat_f64s(factor), x)
    }

    #[inline(always)]
    fn columns(self, row: impl Fn(usize) -> Self::Row) -> [Self::f64s; 3] {
        let avx = self.avx;
        let [r0, r1, r2, r3] = [row(0), row(1), row(2), row(3)].map(pulp::cast);
        // x0 x1 z0 z1 and x2 x3 z2 z3, the same of y
        let (xz01, xz23) = (
            avx._mm256_unpacklo_pd(r0, r1),
            avx._mm256_unpacklo_pd(r2, r3),
        );
        let (yw01, yw23) = (
            avx._mm256_unpackhi_pd(r0, r1),
            avx._mm256_unpackhi_pd(r2, r3),
        );
        [
            pulp::cast(avx._mm256_permute2f128_pd::<0x20>(xz01, xz23)),
            pulp::cast(avx._mm256_permute2f128_pd::<0x20>(yw01, yw23)),
            pulp::cast(avx._mm256_permute2f128_pd::<0x31>(xz01, xz23)),
        ]
    }

    #[inline(always)]
    fn rows(
        self,
        x: [Self::f64s; 3],
        y: [Self::f64s; 3],
        mut take: impl FnMut(usize, Self::Row, Self::Row),
    ) {
        let (x, y) = (turned(self, x), turned(self, y));
        for l in 0..4 {
            take(l, x[l], y[l]);
        }
    }
}

/// Three columns and one of zeros to four rows.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn turned(simd: pulp::x86::V3, columns: [pulp::f64x4; 3]) -> [pulp::f64x4; 4] {
    let avx = simd.avx;
    let [x, y, z] = columns.map(pulp::cast);
    let zero = avx._mm256_setzero_pd();
    let (xy02, xy13) = (avx._mm256_unpacklo_pd(x, y), avx._mm256_unpackhi_pd(x, y));
    let (z02, z13) = (
        avx._mm256_unpacklo_pd(z, zero),
        avx._mm256_unpackhi_pd(z, zero),
    );
    [
        pulp::cast(avx._mm256_permute2f128_pd::<0x20>(xy02, z02)),
        pulp::cast(avx._mm256_permute2f128_pd::<0x20>(xy13, z13)),
        pulp::cast(avx._mm256_permute2f128_pd::<0x31>(xy02, z02)),
        pulp::cast(avx._mm256_permute2f128_pd::<0x31>(xy13, z13)),
    ]
}

#[cfg(target_arch = "aarch64")]
impl Lanes for pulp::aarch64::Neon {
    plain_rows!();

    #[inline(always)]
    fn columns(self, row: impl Fn(usize) -> [f64; 4]) -> [Self::f64s; 3] {
        let (r0, r1) = (row(0), row(1));
        [0, 1, 2].map(|k| pulp::cast([r0[k], r1[k]]))
    }

    #[inline(always)]
    fn rows(
        self,
        x: [Self::f64s; 3],
        y: [Self::f64s; 3],
        mut take: impl FnMut(usize, [f64; 4], [f64; 4]),
    ) {
        let (x, y): ([[f64; 2]; 3], [[f64; 2]; 3]) = (x.map(pulp::cast), y.map(pulp::cast));
        for l in 0..2 {
            take(
                l,
                [x[0][l], x[1][l], x[2][l], 0.0],
                [y[0][l], y[1][l], y[2][l], 0.0],
            );
        }
    }
}

/// Which instructions the sweeps use. All give the same bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Instructions {
    /// The widest set of this machine.
    #[default]
    Widest,
    /// One contact after the other.
    Scalar,
}

/// Work that is compiled once per instruction set.
pub trait Work {
    type Output;
    fn run<S: Lanes>(self, simd: S) -> Self::Output;
}

impl Instructions {
    /// Runs `work` in the best version that is allowed and that this machine has.
    #[inline]
    pub fn run<W: Work>(self, work: W) -> W::Output {
        if self == Self::Widest {
            #[cfg(target_arch = "x86_64")]
            if let Some(simd) = pulp::x86::V3::try_new() {
                return simd.vectorize(
                    #[inline(always)]
                    || work.run(simd),
                );
            }
            #[cfg(target_arch = "aarch64")]
            if let Some(simd) = pulp::aarch64::Neon::try_new() {
                return simd.vectorize(
                    #[inline(always)]
                    || work.run(simd),
                );
            }
        }
        work.run(pulp::Scalar)
    }
}
