# The way to start ranks that the batch files share. `launch COMMAND` runs a command on all tasks of the Slurm job,
# tells it when the job is about to end, and puts the job back into the queue if it gets on but is not done. To be
# sourced in the root of the checkout.
#
# Environment, at submission:
#     CVT_HPC_LAUNCHER=srun|mpirun    what starts the ranks: Slurm itself, or the mpirun of the MPI library
#     CVT_HPC_SRUN_MPI=pmi2|pmix|...  how srun connects them: pmi2 for MPICH and its kin, pmix for Open MPI; `srun
#                                     --mpi=list` shows what there is. A wrong one is refused before anything is
#                                     computed. Ranks that print "mpi/pmi2: request not begin with" have an MPICH that
#                                     cannot go over libfabric, see short_addresses: take mpirun
#     CVT_HPC_CONTAINER=IMAGE.sif     run the ranks in this image (slurm/cvt_hpc.def) by `apptainer exec`; folders
#                                     other than the home, /tmp and the present one: APPTAINER_BIND
#
# Exit statuses of `cvt-hpc run`, and what becomes of the job:
#     0  all runs done             1  some runs failed, their reasons are in the output             2  bad input
#     99 runs remain, and some were done: back into the queue, to go on with what is not yet recorded
#     98 runs remain, and none was done: the job ends, since it would go round in circles; it needs more time
#     70 a defect of the program, described in crash.log in the output folder
# A sweep that was cancelled or lost its node goes on when the same command is submitted again. A job that lost
# its node is put back into the queue by Slurm. What is recorded is never computed twice.

set -u

# SITE: the MPI and the Python that mpi4py was built with, where they come from modules.
# module load python mpich

export PATH="$PWD/.venv/bin:$PATH"
image=()
if [ -n "${CVT_HPC_CONTAINER:-}" ]; then
    image=(apptainer exec "$CVT_HPC_CONTAINER")
fi
# One rank a core: threads of numerical libraries would only get in each other's way.
export OMP_NUM_THREADS=1
if [ -n "${TMPDIR:-}" ] && { [ ! -d "$TMPDIR" ] || [ ! -w "$TMPDIR" ]; }; then # such as that of the login node
    echo "TMPDIR: $TMPDIR is no folder to write to on ${HOSTNAME:-this node}; /tmp is used instead" >&2
    unset TMPDIR
fi
# Machine code is kept on a disk of each node, in a folder of this job alone, which is removed at its end: caches on
# network file systems are slow, and not always sound. A NUMBA_CACHE_DIR that is set at submission is used instead and
# stays, so that further jobs need not compile again.
own_cache=
if [ -z "${NUMBA_CACHE_DIR:-}" ]; then
    own_cache=$(mktemp -d "${TMPDIR:-/tmp}/cvt_hpc-numba-XXXXXXXXXX") || exit 2
    trap 'rm -rf -- "$own_cache"' EXIT
    export NUMBA_CACHE_DIR=$own_cache
fi

# Slurm reads 1024 bytes of a request by PMI and takes the rest for another one; ranks then wait for each other for ever
# or die. MPICH writes addresses for UCX in up to 1060 bytes, now and then, and those for libfabric (ofi) in a tenth.
short_addresses() {
    if [ -z "${MPIR_CVAR_CH4_NETMOD:-}" ] && "${image[@]}" mpichversion 2> /dev/null | grep -q '^MPICH Device:.*ch4.*\<ofi\>'; then
        export MPIR_CVAR_CH4_NETMOD=ofi
    fi
}

launch() {
    local launcher status
    case ${CVT_HPC_LAUNCHER:-srun} in
        # --wait: should a rank die without a word (out of memory), the others are ended a minute later, not left
        # waiting.
        srun)
            short_addresses
            srun --mpi="${CVT_HPC_SRUN_MPI:-pmi2}" --wait=60 "${image[@]}" "$@" &
            ;;
        mpirun) mpirun -n "$SLURM_NTASKS" "${image[@]}" "$@" & ;;
        *)
            echo "CVT_HPC_LAUNCHER: expected srun or mpirun, found $CVT_HPC_LAUNCHER" >&2
            exit 2
            ;;
    esac
    launcher=$!
    # Slurm warns this shell alone (--signal=B:USR1@...), since it knows of no ranks that mpirun has started on this
    # node; both launchers pass the warning on to all ranks.
    trap 'kill -USR1 "$launcher"' USR1
    wait "$launcher"
    status=$?
    while [ "$status" -eq $((128 + $(kill -l USR1))) ]; do # it was the wait that the signal ended
        wait "$launcher"
        status=$?
    done
    if [ -n "$own_cache" ] && [ "${SLURM_NNODES:-1}" -gt 1 ]; then # the trap removes that of this node alone
        srun --mpi=none --ntasks="$SLURM_NNODES" --ntasks-per-node=1 rm -rf -- "$own_cache"
    fi
    if [ "$status" -eq 99 ]; then
        echo "runs remain: back into the queue"
        scontrol requeue "$SLURM_JOB_ID" || echo "to go on, submit the same command again"
    fi
    exit "$status"
}
