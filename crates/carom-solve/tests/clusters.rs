//! The union-find.

use carom_solve::clusters::{apart, Forest};

#[test]
fn roots_are_the_smallest_of_their_clusters_in_any_order_of_joining() {
    let pairs = [(5, 3), (1, 4), (3, 1), (7, 6)];
    for first in 0..pairs.len() {
        let mut forest = apart(8);
        for k in 0..pairs.len() {
            let (a, b) = pairs[(first + k) % pairs.len()];
            forest.join(a, b);
        }
        let roots: Vec<u32> = (0..8).map(|i| forest.root(i)).collect();
        assert_eq!(roots, [0, 1, 2, 1, 1, 1, 6, 6]);
    }
}
