#include "signals.h"

int64_t sb_slot_read(SbSlot *slot, const uint8_t *data, int n_data) {
    if (n_data != slot->length) {
        return 0;
    }
    for (int k = 0; k < SB_NUMBER_COUNTER; k++) {
        slot->number[k] = slot->place[k] >= 0 ? signal_raw(slot->signals, slot->place[k], data) : 0;
    }
    const SbCheck *check = slot->check;
    const int64_t none = check == NULL ? -1 : 0, counts = check != NULL && check->counter_byte < n_data;
    slot->number[SB_NUMBER_COUNTER] = counts ? data[check->counter_byte] & check->counter_bits : none;
    return 1;
}

int64_t sb_slot_check(SbSlot *slot, const double *time, const uint8_t *data, int n_data) {
    const int64_t status = slot->check ? sb_check(slot->check, time, data, n_data, data, 0) : SB_OK;
    const int is_other = slot->place[SB_NUMBER_CONFIGURATION] >= 0 && status != SB_ERROR &&
                         slot->number[SB_NUMBER_CONFIGURATION] != slot->expected;
    sb_machine_add(slot->machine, is_other ? SB_ERROR : (int)status);
    return status | (is_other ? SB_CONFIGURATION_OF : 0);
}

int64_t sb_slot_receive(SbSlot *slot, const double *time, const uint8_t *data, int n_data) {
    return sb_slot_read(slot, data, n_data) ? sb_slot_check(slot, time, data, n_data) : -1;
}
