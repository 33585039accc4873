#!/bin/bash
# Workers on a Slurm cluster: `sbatch docs/deploy/slurm.sh`.
#
# An array of independent tasks: nodes may come and go, and the campaign continues with the others.
#SBATCH --job-name=tracktwin
#SBATCH --array=1-50
#SBATCH --cpus-per-task=16
#SBATCH --mem-per-cpu=500M
#SBATCH --time=04:00:00
# Signal before the kill: the worker finishes what it has begun and returns the other cases.
#SBATCH --signal=B:TERM@20
# If a node fails, its task returns to the queue.
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=tracktwin-%A_%a.log
set -u

: "${TRACKTWIN_COORDINATOR:?address of the coordinator, such as https://head:7700}"
export TRACKTWIN_CORES="$SLURM_CPUS_PER_TASK"

# In the background, so that the shell can forward the signal.
tracktwin-worker --tls-ca "${CERTS:-$HOME/certs}/ca.pem" --token-file "${CERTS:-$HOME/certs}/token" \
    --idle-exit 300 --give-up-after 1800 &
worker=$!
trap 'kill -TERM "$worker"' TERM
wait "$worker"
code=$?
# Interrupted by the signal: wait until the worker ends.
if kill -0 "$worker" 2>/dev/null; then wait "$worker"; code=$?; fi

# Retry after 3 (no coordinator for half an hour), not after 0 or 2.
if [ "$code" -eq 3 ]; then scontrol requeue "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}"; fi
exit "$code"
