#!/usr/bin/env bash
# Draws the shipped five-episode datasets (examples/data) from the shipped behaviour policies (examples/policies).
# Targets: nominal; "shifted" = friction x 0.6, gain x 1.3, gravity x 1.2; the quickstart's = 0.5, 0.7, 1.3.
# Usage: scripts/make_demonstrations.sh [oted] [task ...]
#
# The policies themselves (one training run per task; about an hour of one core each), with Stable-Baselines3's settings:
#   plain="--set sac.n_lanes=1 --set sac.multi_step=1 --set sac.normalize_observations=false"
#   large="$plain --set sac.hidden=256,256 --set sac.batch_size=256 --set sac.learning_rate=3e-4"
#   oted behavior --task Hopper-v5      --seed 1 --threads 1 $large --set sac.n_steps=250000 --out examples/policies/hopper
#   oted behavior --task HalfCheetah-v5 --seed 1 --threads 1 $large --set sac.n_steps=200000 --out examples/policies/halfcheetah
#   oted behavior --task Walker2d-v5    --seed 1 --threads 1 $plain --set sac.n_steps=600000 --set sac.hidden=128,128 \
#     --set sac.batch_size=128 --set sac.learning_rate=0.001 --set sac.eval_interval=20000 --out examples/policies/walker2d
set -euo pipefail
cd "$(dirname "$0")/.."
oted=${1:-build/release/oted}
shift || true
tasks=("$@")
[ ${#tasks[@]} -gt 0 ] || tasks=(hopper halfcheetah walker2d)
declare -A names=([hopper]=Hopper-v5 [halfcheetah]=HalfCheetah-v5 [walker2d]=Walker2d-v5)

parameters=(--param 'friction=geom/*/friction[0]:0.2:2.0' --param 'gain=actuator/*/gainprm[0]:0.2:2.0'
            --param 'gravity=opt/gravity[2]:0.2:2.0')
shifted=("${parameters[@]}" --truth friction=0.6 --truth gain=1.3 --truth gravity=1.2)
quickstart=("${parameters[@]}" --truth friction=0.5 --truth gain=0.7 --truth gravity=1.3)

collect() {  # task output policies... -- target...
  local task=$1 output=$2; shift 2
  "$oted" collect --task "${names[$task]}" --seed 1 --episodes 5 --out "examples/data/$output.hdf5" "$@"
}
for task in "${tasks[@]}"; do
  policies=examples/policies/$task
  collect "$task" "$task-medium" --policy "$policies/medium.npz"
  collect "$task" "$task-expert" --policy "$policies/expert.npz"
  collect "$task" "$task-medium-expert" --policy "$policies/medium.npz" --policy "$policies/expert.npz"
  collect "$task" "$task-medium-shifted" --policy "$policies/medium.npz" "${shifted[@]}"
  [ "$task" != hopper ] || collect hopper hopper-quickstart --policy "$policies/medium.npz" "${quickstart[@]}"
done
