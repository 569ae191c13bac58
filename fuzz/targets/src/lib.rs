//! What fuzzing does with arbitrary bytes, and what must hold of it: a function per target, which panics where it does not.
//!
//! | target | bytes become | must hold |
//! |---|---|---|
//! | [`scene`] | model, options, a few steps of any method | numbers stay numbers or the outcome says why; cones; energy |
//! | [`state`] | a saved state with damage, read and gone on from | the same, or refused |
//! | [`solve`] | a contact problem, its solver and settings | `converged` is true of what comes back |
//! | [`neighbours`] | spheres of all sizes and walls that move | the list and the overlaps are those of brute force |
//! | [`walls`] | a wall and a sphere | unit normals, gaps that change as the normal says |
//! | [`expression`] | text | a value, or a message with a column |
//!
//! The same functions run under libFuzzer (`fuzz/src`) and, over the kept corpora, in `cargo test` (`tests/corpora.rs`).

mod draw;
mod expression;
mod neighbours;
mod scene;
mod solve;
mod state;
mod walls;

pub use expression::expression;
pub use neighbours::neighbours;
pub use scene::scene;
pub use solve::solve;
pub use state::state;
pub use walls::walls;

/// A target: its name, and what it does with bytes.
pub type Target = (&'static str, fn(&[u8]));

/// Every target by its name, which is that of its corpus.
pub const TARGETS: [Target; 6] = [
    ("scene", scene),
    ("state", state),
    ("solve", solve),
    ("neighbours", neighbours),
    ("walls", walls),
    ("expression", expression),
];
