#include "strainbus.h"

int64_t sb_version(void) {
    return SB_VERSION;
}

int64_t sb_sizes(int64_t *size) {
    const size_t sizes[] = {
        sizeof(SbDecoder), sizeof(SbCycle),   sizeof(SbWatch), sizeof(SbClock), sizeof(SbValue),      sizeof(SbFlow),
        sizeof(SbChecks),  sizeof(SbCheck),   sizeof(SbMachine), sizeof(SbSlot), sizeof(SbParts),     sizeof(SbAssembler),
        sizeof(SbProof),   sizeof(SbStrainTime), sizeof(SbBucket), sizeof(SbPort), sizeof(SbJudge),
        sizeof(SbRepeats), sizeof(SbEncoder),
    };
    const int64_t count = sizeof sizes / sizeof *sizes;
    for (int64_t k = 0; k < count; k++) {
        size[k] = (int64_t)sizes[k];
    }
    return count;
}
